"""Changes of the sensor and of lights in words, for undo and redo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.picture.light_settings import lights_of
from flyaround.gui.picture.sensor_terms import terms_of
from flyaround.gui.picture.view_settings import changed_sensor
from flyaround.gui.texts import titles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.gui.command_table import Value
    from flyaround.gui.picture.view_settings import ViewSettings
    from flyaround.simulator.scene.state import SceneState


def change_text(
    name: str, values: Sequence[Value], scene: SceneState, before: ViewSettings, after: ViewSettings
) -> str:
    """Return what a command of the sensor or of a light changed, with old and new value.

    Parameters
    ----------
    name : str
        Name of the command.
    values : sequence of Value
        Its arguments.
    scene : SceneState
        Scene with the scenario's own sensor and lights.
    before : ViewSettings
        Settings before the command.
    after : ViewSettings
        Settings after it.

    Returns
    -------
    str
        The change in words; empty for another command.
    """
    if name == "sensor.set":
        which, of = str(values[0]), ""
        sensors = (changed_sensor(scene.sensor, settings.sensor_changes) for settings in (before, after))
        old, new = (next(t.value for t in terms_of(s) if t.name == which) for s in sensors)
    elif name in {"light.set", "light.switch", "light.remove"}:
        k = int(values[0])
        was, now = (lights_of(scene) if s.lights is None else s.lights for s in (before, after))
        title = was[k].title[:1].lower() + was[k].title[1:]
        if name != "light.set":
            return f"remove {title}" if name == "light.remove" else f"{title} {'on' if now[k].on else 'off'}"
        which, of = str(values[1]), f" of the {title}"
        old, new = (getattr(lights[k].light, which) for lights in (was, now))
    else:
        return ""
    return f"{titles().get(which, which)}{of} from {_figure(old)} to {_figure(new)}"


def _figure(value: object) -> str:
    if isinstance(value, float | int):
        return f"{value:g}"
    return ", ".join(map(_figure, value)) if isinstance(value, tuple | list) else str(value or "none")
