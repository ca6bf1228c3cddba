"""Commands of the camera, its sensor and the lights, for the console's pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, command, number, word
from flyaround.gui.picture.sensor_terms import checked_change
from flyaround.simulator.camera.lens.files import list_cameras, load_camera
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.gui.console import Console

SCENARIO = "scenario"
MOST_GAIN = 100.0


def _use(console: Console, camera: str) -> None:
    console.options.settings.camera = None if camera == SCENARIO else load_camera(camera)


def _set(console: Console, name: str, value: float) -> None:
    settings, sensor = console.options.settings, console.session.scene().sensor
    settings.sensor_changes = checked_change(sensor, settings.sensor_changes, name, value)


def _reset(console: Console) -> None:
    settings = console.options.settings
    settings.sensor_changes, settings.camera, settings.noise = {}, None, True


def _gain(console: Console, light: int, gain: float) -> None:
    n = len(console.session.scene().area_lights)
    if light >= n:
        raise UserError(f"there is no light {light}; this scenario has {n}, numbered from 0")
    settings = console.options.settings
    settings.light_gains = {**settings.light_gains, light: gain}


COMMANDS = (
    command(
        "camera.use", _use, arguments=(word("camera", "name of the camera", (SCENARIO, *list_cameras())),)
    ),
    command(
        "sensor.set",
        _set,
        arguments=(
            word("name", "of the number"),
            number("value", "its value, in the unit that the panel shows", unit="its unit"),
        ),
    ),
    command("sensor.reset", _reset),
    command(
        "light.gain",
        _gain,
        arguments=(
            Argument("light", "whole", "its number, from 0", least=0, most=1000),
            number("gain", "as bright as the scenario has it", 0.0, MOST_GAIN, "times"),
        ),
    ),
)
