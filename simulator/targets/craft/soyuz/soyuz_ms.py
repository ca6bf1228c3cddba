"""Soyuz MS with its wings out and the probe ready to dock."""

from __future__ import annotations

from flyaround.simulator.targets.craft.assemble import assemble
from flyaround.simulator.targets.craft.finishes import FINISHES
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.craft.soyuz.fittings import build_fittings
from flyaround.simulator.targets.craft.soyuz.labels import (
    build_keypoints,
    build_mass,
    build_occluders,
    build_wireframe,
)
from flyaround.simulator.targets.craft.soyuz.modules import build_modules
from flyaround.simulator.targets.craft.soyuz.shape import COLLAR_M, SKIRT_LOW_M
from flyaround.simulator.targets.level_of_detail import Detail
from flyaround.simulator.targets.model import Target

NOTES = (
    "z towards the docking probe, origin where descent and service module meet, x along the wings, cells towards +y. "
    "Length 7.48 m, greatest diameter 2.72 m, span 10.7 m: public figures; lengths and masses "
    "of modules: Hall & Shayler (2003). "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_soyuz_ms(detail: Detail = "full") -> Target:
    """Soyuz MS at a level of detail; labels are the same at all."""
    level = Level(detail)
    return assemble(
        name="soyuz-ms",
        title="Soyuz MS",
        pieces=[*build_modules(level), *build_fittings(level)],
        materials=FINISHES,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        mass=build_mass(),
        frames={
            "docking": ((0.0, 0.0, COLLAR_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, SKIRT_LOW_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )
