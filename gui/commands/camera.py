"""Commands of the camera, its sensor and the lights, for the console's pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.gui.command_table import STATE, Argument, command, word
from flyaround.gui.picture import light_settings
from flyaround.gui.picture.sensor_terms import checked_change
from flyaround.gui.texts import titles
from flyaround.simulator.camera.lens.files import list_cameras, load_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.console import Console
    from flyaround.gui.picture.light_settings import Lights, SwitchedLight

SCENARIO = "scenario"


def _use(console: Console, camera: str) -> None:
    console.options.settings.camera = None if camera == SCENARIO else load_camera(camera)


def _set(console: Console, name: str, value: str) -> None:
    settings, sensor = console.options.settings, console.session.scene().sensor
    settings.sensor_changes = checked_change(sensor, settings.sensor_changes, name, value)


def _reset(console: Console) -> None:
    settings = console.options.settings
    settings.sensor_changes, settings.camera, settings.noise = {}, None, True


def _lights(console: Console) -> Lights:
    lights = console.options.settings.lights
    return light_settings.lights_of(console.session.scene()) if lights is None else lights


def _replace(console: Console, light: int, change: Callable[[SwitchedLight], Lights]) -> None:
    """Replace one light by what ``change`` returns for it."""
    lights = _lights(console)
    if light >= len(lights):
        raise UserError(f"there is no light {light}; there are {len(lights)}, numbered from 0")
    new = change(lights[light])
    console.options.settings.lights = (*lights[:light], *new, *lights[light + 1 :])


def _switch(console: Console, light: int, state: bool | None = None) -> None:  # noqa: FBT001 - a switch
    _replace(console, light, lambda s: (replace(s, on=not s.on if state is None else state),))


def _change(console: Console, light: int, field: str, value: str) -> None:
    _replace(console, light, lambda s: (light_settings.changed_light(s, field, value),))
    console.say(
        f"{_lights(console)[light].title}: {titles().get(field, field)} is now {value.replace(',', ' ')}"
    )


def _add(console: Console, kind: str) -> None:
    console.options.settings.lights = light_settings.with_light(_lights(console), kind)


def _fly_lights(console: Console) -> None:
    console.opener.open(light_settings.scenario_with(console.session.plan.scenario, _lights(console)))


LIGHT = Argument("light", "whole", "its number in the panel, from 0", least=0, most=MAX_LIGHTS)
FIELD = word("field", "as [lamp] or [[lights]] of a scenario")
TERM = word("value", "a number, in the unit that the panel shows")
KIND = word("kind", "on the chaser, or a luminous area", tuple(light_settings.NEW_LIGHTS))

COMMANDS = (
    command("camera.use", _use, word("camera", "name of the camera", (SCENARIO, *list_cameras()))),
    command("sensor.set", _set, word("name", "of the number"), TERM),
    command("sensor.reset", _reset),
    command("light.switch", _switch, LIGHT, STATE),
    command("light.set", _change, LIGHT, FIELD, word("value", "a, or a,b,c")),
    command("light.add", _add, KIND),
    command("light.remove", lambda console, light: _replace(console, light, lambda _: ()), LIGHT),
    command("light.reset", lambda console: setattr(console.options.settings, "lights", None)),
    command("light.fly", _fly_lights),
)
