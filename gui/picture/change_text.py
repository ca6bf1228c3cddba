"""Changes of settings, lights and burns in words, for undo and redo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import word_of
from flyaround.gui.picture.light_settings import lights_of
from flyaround.gui.picture.sensor_terms import terms_of
from flyaround.gui.picture.view_settings import changed_sensor, exposure_text
from flyaround.gui.texts import titles
from flyaround.simulator.piloting.planned_burns import change_text as burns_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.gui.command_table import Command, Value
    from flyaround.gui.picture.view_settings import Options
    from flyaround.simulator.piloting.session import FlightSession


def change_text(
    command: Command, values: Sequence[Value], session: FlightSession, before: Options, after: Options
) -> str:
    """Return what a command changed: of sensor, lights and burns with old and new value, the exposure as a time.

    Parameters
    ----------
    command : Command
        The command.
    values : sequence of Value
        Its arguments.
    session : FlightSession
        The flight, with its own sensor and lights.
    before : Options
        Settings before the command.
    after : Options
        Settings after it.
    """
    scene, both = session.scene(), (before.settings, after.settings)
    if command.group == "burn" and before.flight is not None:
        return burns_text(before.flight.burns, session.craft.steering.burns)
    if command.name in {"picture.exposure", "picture.meter"}:
        exposure_s = session.plan.scenario.sensor.exposure_s * 2.0**after.settings.exposure_stops
        return f"exposure {exposure_text(exposure_s)}"
    if command.name == "sensor.set":
        which, of = str(values[0]), ""
        sensors = (changed_sensor(scene.sensor, settings.sensor_changes) for settings in both)
        old, new = (next(t.value for t in terms_of(s) if t.name == which) for s in sensors)
    elif command.name in {"light.set", "light.switch", "light.remove"}:
        k = int(values[0])
        was, now = (lights_of(scene) if s.lights is None else s.lights for s in both)
        title = was[k].title[:1].lower() + was[k].title[1:]
        if command.name == "light.remove":
            return f"remove {title}"
        if command.name == "light.switch":
            return f"{title} {'on' if now[k].on else 'off'}"
        which, of = str(values[1]), f" of the {title}"
        old, new = (getattr(lights[k].light, which) for lights in (was, now))
    else:
        words = (titles().get(word, word) for word in map(word_of, values))
        return " ".join([command.title[:1].lower() + command.title[1:], *words])
    return f"{titles().get(which, which)}{of} from {_figure(old)} to {_figure(new)}"


def _figure(value: object) -> str:
    if isinstance(value, float | int):
        return f"{value:g}"
    return ", ".join(map(_figure, value)) if isinstance(value, tuple | list) else str(value or "none")
