"""Lamps and area lights as the operator switches, changes, adds and removes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.texts import with_titles
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.validation_errors import convert_document
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS, AreaLight
from flyaround.simulator.scene.illumination.lamp import Lamp

if TYPE_CHECKING:
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState

NEW_LIGHTS: dict[str, Lamp | AreaLight] = {
    "lamp": Lamp(power_w=40.0),
    "box": AreaLight(position_m=(2.0, -2.0, 0.0), radiance_w_m2_sr=500.0),
}
"""A lamp beside the camera, and a box above it, as they are added."""


@dataclass(frozen=True)
class SwitchedLight:
    """A lamp on the chaser or an area light, and its switch."""

    light: Lamp | AreaLight
    on: bool = True

    @property
    def title(self) -> str:
        """Kind of the light."""
        return "Lamp on the chaser" if isinstance(self.light, Lamp) else "Box"


Lights = tuple[SwitchedLight, ...]


def lights_of(scene: SceneState) -> Lights:
    """Return the lights of a scene, the lamp first."""
    lamps = () if scene.lamp is None else (scene.lamp,)
    return tuple(SwitchedLight(light) for light in (*lamps, *scene.area_lights))


def lit(scene: SceneState, lights: Lights | None) -> SceneState:
    """Return the scene with these lights instead of its own, unless they are None."""
    if lights is None:
        return scene
    lamp, boxes = _lamp_and_boxes(lights)
    return replace(scene, lamp=lamp, lights=tuple(boxes) or msgspec.UNSET)


def scenario_with(scenario: Scenario, lights: Lights) -> Scenario:
    """Return the scenario with these lights instead of its own."""
    lamp, boxes = _lamp_and_boxes(lights)
    return msgspec.structs.replace(scenario, lamp=lamp, lights=boxes)


def with_light(lights: Lights, kind: str) -> Lights:
    """Return the lights with a new one of this kind.

    Raises
    ------
    UserError
        If there is no room for it.
    """
    most = 1 if kind == "lamp" else MAX_LIGHTS
    if sum(isinstance(s.light, type(NEW_LIGHTS[kind])) for s in lights) >= most:
        raise UserError(f"a flight has at most {most} {kind}{'es' * (most > 1)}: remove one, or change it")
    return (*lights, SwitchedLight(NEW_LIGHTS[kind]))


def changed_light(switched: SwitchedLight, field: str, text: str) -> SwitchedLight:
    """Return the light with another value of a field.

    Parameters
    ----------
    switched : SwitchedLight
        Light to change.
    field : str
        Name of the field of `Lamp` or `AreaLight`.
    text : str
        A number, a word, or three numbers separated by commas.

    Raises
    ------
    UserError
        If the light has no such field, or the value is not allowed.
    """
    kind = type(switched.light)
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        value: object = text
    else:
        value = numbers if len(numbers) > 1 else numbers[0]
    raw = {**msgspec.structs.asdict(switched.light), field: value}
    try:
        return replace(switched, light=convert_document(raw, kind, "light"))
    except UserError as error:
        raise UserError(with_titles(str(error))) from error


def _lamp_and_boxes(lights: Lights) -> tuple[Lamp | None, list[AreaLight]]:
    on = [s.light for s in lights if s.on]
    return next((x for x in on if isinstance(x, Lamp)), None), [x for x in on if isinstance(x, AreaLight)]
