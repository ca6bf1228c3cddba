"""Tianzhou with its wings out."""

from __future__ import annotations

from flyaround.simulator.targets.craft.assemble import assemble
from flyaround.simulator.targets.craft.finishes import FINISHES
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.craft.tianzhou.fittings import build_fittings
from flyaround.simulator.targets.craft.tianzhou.labels import (
    build_keypoints,
    build_mass,
    build_occluders,
    build_wireframe,
)
from flyaround.simulator.targets.craft.tianzhou.modules import build_modules
from flyaround.simulator.targets.craft.tianzhou.shape import DRIVE_LOW_M, PORT_M
from flyaround.simulator.targets.level_of_detail import Detail
from flyaround.simulator.targets.model import Target

NOTES = (
    "z towards the docking port, origin where propulsion and cargo module meet, x along the wings, cells towards +y. "
    "Length 10.6 m, diameter 3.35 m, propulsion module 2.8 m, span 14.9 m, mass 13.5 t: public figures of Tianzhou-1. "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_tianzhou(detail: Detail = "full") -> Target:
    """Tianzhou at a level of detail; labels are the same at all."""
    level = Level(detail)
    return assemble(
        name="tianzhou",
        title="Tianzhou cargo craft",
        pieces=[*build_modules(level), *build_fittings(level)],
        materials=FINISHES,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        mass=build_mass(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, DRIVE_LOW_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )
