"""Crew Dragon as it flies an approach: trunk attached, nose cone open, docking port free."""

from __future__ import annotations

from flyaround.simulator.targets.builders.assembly import Piece
from flyaround.simulator.targets.craft.assemble import assemble
from flyaround.simulator.targets.craft.dragon.crew_capsule import build_capsule
from flyaround.simulator.targets.craft.dragon.crew_labels import (
    build_keypoints,
    build_mass,
    build_occluders,
    build_wireframe,
)
from flyaround.simulator.targets.craft.dragon.crew_nose import build_nose
from flyaround.simulator.targets.craft.dragon.crew_shape import PORT_M, TRUNK_LOW_M
from flyaround.simulator.targets.craft.dragon.crew_trunk import build_trunk
from flyaround.simulator.targets.craft.finishes import FINISHES
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.level_of_detail import Detail
from flyaround.simulator.targets.model import Target

NOTES = (
    "z towards the docking port, origin where capsule and trunk meet, x towards the side hatch. "
    "Height 8.1 m with closed nose cone, diameter 4 m: SpaceX's public figures; trunk 3.7 m wide; "
    "port: International Docking System Standard. Sizes of fittings are judged on photographs; the mass distribution "
    "is an estimate. No symmetry: cells, hatch and nose cone tell the quarters apart."
)


def build_dragon(detail: Detail = "full") -> Target:
    """Crew Dragon at a level of detail; labels are the same at all."""
    return assemble(
        name="dragon",
        title="Crew Dragon with trunk, nose cone open",
        pieces=dragon_pieces(Level(detail)),
        materials=FINISHES,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        mass=build_mass(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, TRUNK_LOW_M), (0.0, 0.0, -1.0)),
        },
        notes=NOTES,
    )


def dragon_pieces(level: Level, *, nose_closed: bool = False) -> list[Piece]:
    """All pieces; with the nose cone closed, the craft is as high as its data sheet says."""
    return [*build_capsule(level), *build_nose(level, closed=nose_closed), *build_trunk(level)]
