"""Cargo Dragon (2010 to 2020) on orbit: nose cap gone, wings out, sensor bay open."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.targets.craft.assemble import assemble
from flyaround.simulator.targets.craft.dragon.cargo_body import build_body
from flyaround.simulator.targets.craft.dragon.cargo_labels import (
    build_keypoints,
    build_mass,
    build_occluders,
    build_wireframe,
)
from flyaround.simulator.targets.craft.dragon.cargo_shape import (
    BAY_AZIMUTH_DEG,
    BAY_Z_M,
    PORT_M,
    SIDEWALL,
    WINGS,
)
from flyaround.simulator.targets.craft.finishes import FINISHES
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.level_of_detail import Detail
from flyaround.simulator.targets.model import Target

NOTES = (
    "z towards the berthing port, origin where capsule and trunk meet, x along the wings, cells towards +y. "
    "Height 7.2 m with nose cap (6.1 m on orbit), diameter 3.7 m, span 16.5 m: press kit of CRS-6; "
    "port: Common Berthing Mechanism. "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_dragon_cargo(detail: Detail = "full") -> Target:
    """Cargo Dragon at a level of detail; labels are the same at all."""
    level = Level(detail)
    bay = np.deg2rad(BAY_AZIMUTH_DEG)
    out = SIDEWALL.normal(bay, BAY_Z_M)
    return assemble(
        name="dragon-cargo",
        title="Cargo Dragon (2010 to 2020) with solar wings",
        pieces=[*build_body(level), *WINGS.pieces(level)],
        materials=FINISHES,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        mass=build_mass(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": (vec3(SIDEWALL.point(bay, BAY_Z_M) + 0.33 * out), vec3(out)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )
