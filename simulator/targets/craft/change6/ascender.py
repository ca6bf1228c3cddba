"""The ascent vehicle of Chang'e-6, as it waits in lunar orbit for the orbiter's clamps.

Public record: an octagonal body about 1.5 m wide in golden insulation, four spherical tanks, one 3 kN engine below, two
folding wings that are nearly round, small thrusters round the deck, and on top the grips that the orbiter's three claws
pull in and the port through which the samples pass (CNSA and CGTN releases on Chang'e-5 and -6, 2020 and 2024;
Hu et al., Design and verification of the docking mechanism of Chang'e-5, Sci. China Technol. Sci. 2021). About 700 to
800 kg with propellant. Sizes below the body's width are read off published pictures and are estimates.

Frame: origin at the middle of the lower deck's underside, z along the docking axis away from the engine, wings on +-y.
"""

from __future__ import annotations

from flyaround.simulator.targets.craft.assemble import assemble_lumped
from flyaround.simulator.targets.craft.change6.body import build_body, build_propulsion, build_tanks
from flyaround.simulator.targets.craft.change6.dimensions import (
    ENGINE_LENGTH_M,
    ENGINE_TOP_M,
    PORT_TOP_M,
)
from flyaround.simulator.targets.craft.change6.fittings import build_deck, build_sides
from flyaround.simulator.targets.craft.change6.labels import (
    build_keypoints,
    build_lumps,
    build_occluders,
    build_wireframe,
)
from flyaround.simulator.targets.craft.change6.wings import build_wings
from flyaround.simulator.targets.craft.finishes import FINISHES
from flyaround.simulator.targets.level_of_detail import Detail
from flyaround.simulator.targets.model import Target

NOTES = (
    "Origin at the middle of the lower deck, z away from the engine. Width and arrangement from public releases; "
    "other sizes read off pictures; mass split estimated."
)


def build_change6_ascender(detail: Detail = "full") -> Target:
    """The ascent vehicle, wings deployed."""
    return assemble_lumped(
        "change6-ascender",
        "Chang'e-6 ascent vehicle",
        pieces=[
            *build_body(detail),
            *build_tanks(detail),
            *build_propulsion(detail),
            *build_deck(detail),
            *build_sides(detail),
            *build_wings(detail),
        ],
        materials=FINISHES,
        keypoints=build_keypoints(),
        wireframe=build_wireframe(),
        occluders=build_occluders(),
        lumps=build_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_TOP_M), (0.0, 0.0, 1.0)),
            "engine": ((0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )
