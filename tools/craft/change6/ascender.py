"""Ascent vehicle of Chang'e-6, as it waits in lunar orbit for the orbiter's clamps.

Public record: an octagonal body about 1.5 m wide in golden insulation, four spherical tanks, one 3 kN engine below, two
folding wings that are nearly round, small thrusters round the deck, and on top the grips that the orbiter's three claws
pull in and the port through which the samples pass (CNSA and CGTN releases on Chang'e-5 and -6, 2020 and 2024;
Hu et al., Design and verification of the docking mechanism of Chang'e-5, Sci. China Technol. Sci. 2021). About 700 to
800 kg with propellant. Sizes below the body's width are read off published images and are estimates.

Frame: origin at the middle of the lower deck's underside, z along the docking axis away from the engine, wings on +-y.
"""

from __future__ import annotations

import itertools

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import assemble
from tools.craft.change6.body import build_body, build_propulsion, build_tanks
from tools.craft.change6.dimensions import (
    BODY_TOP_M,
    CORE_INSET_M,
    DECK_M,
    ENGINE_EXIT_M,
    ENGINE_LENGTH_M,
    ENGINE_TOP_M,
    ENGINE_WALL_M,
    PORT_RADIUS_M,
    PORT_TOP_M,
    TANK_RADIUS_M,
    TANK_XY_M,
    TANK_Z_M,
    WING_PLATE_M,
    WING_RADIUS_M,
    WING_Y_M,
    WING_Z_M,
    octagon,
    wing_outline,
)
from tools.craft.change6.fittings import build_deck, build_sides
from tools.craft.change6.wings import build_wings
from tools.craft.hardware import sphere
from tools.craft.labels import prism_edges, rim_point, ring_edges
from tools.craft.mass import MassElement
from tools.craft.place import both_sides
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import cone

NOTES = (
    "Origin at the middle of the lower deck, z away from the engine. Width and arrangement from public releases; "
    "other sizes read off pictures; mass split estimated."
)


def build_change6_ascender(detail: Detail = "full") -> Target:
    """Return the ascent vehicle, wings deployed."""
    return assemble(
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
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_TOP_M), (0.0, 0.0, 1.0)),
            "engine": ((0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _keypoints() -> dict[str, Vec3]:
    """Return the corners of body and wings, rims of engine and port, tips."""
    names = ("px_py", "py_px", "py_nx", "nx_py", "nx_ny", "ny_nx", "ny_px", "px_ny")
    ring = octagon()
    order = np.argsort(np.arctan2(ring[:, 1], ring[:, 0]) % (2 * np.pi))
    points = {
        f"deck_{a}": (float(x), float(y), BODY_TOP_M) for a, (x, y) in zip(names, ring[order], strict=True)
    }
    points |= {f"base_{a}": (x, y, 0.0) for a, (x, y, _) in [(k[5:], p) for k, p in points.items()][::2]}
    out, side = WING_Y_M + WING_RADIUS_M, WING_RADIUS_M
    for b, sy in (("ny", -1), ("py", 1)):
        points[f"wing_{b}_tip"] = (0.0, sy * out, WING_Z_M + 0.004)
        points[f"wing_{b}_nx"] = (-side, sy * WING_Y_M, WING_Z_M + 0.004)
        points[f"wing_{b}_px"] = (side, sy * WING_Y_M, WING_Z_M + 0.004)
    exit_m = (0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M)
    points |= {
        f"nozzle_rim_{k}": rim_point(exit_m, (0, 0, -1), ENGINE_EXIT_M + ENGINE_WALL_M, k) for k in range(4)
    }
    points |= {f"port_rim_{k}": rim_point((0, 0, PORT_TOP_M), (0, 0, 1), PORT_RADIUS_M, k) for k in range(4)}
    return points


def _wireframe() -> list[Edge]:
    """Return the outlines of decks and wings, rims of engine and port."""
    edges = prism_edges("deck_upper", octagon(), DECK_M, origin_m=(0, 0, BODY_TOP_M - DECK_M))
    edges += prism_edges("deck_lower", octagon(), DECK_M)
    exit_m = (0.0, 0.0, ENGINE_TOP_M - ENGINE_LENGTH_M)
    edges += ring_edges("nozzle", exit_m, (0, 0, -1), ENGINE_EXIT_M + ENGINE_WALL_M, 64)
    edges += ring_edges("port", (0, 0, PORT_TOP_M), (0, 0, 1), PORT_RADIUS_M, 64)
    low, thick = WING_Z_M - WING_PLATE_M, WING_PLATE_M + 0.004
    outline = wing_outline()
    edges += prism_edges("wing_py", outline, thick, origin_m=(0, 0, low))
    edges += prism_edges("wing_ny", outline * (1, -1), thick, origin_m=(0, 0, low))
    return edges


def _occluders() -> list[Mesh]:
    """Return the body, tanks, wings and engine as coarse closed bodies."""
    wing = prism(wing_outline(), WING_PLATE_M, origin_m=(0, 0, WING_Z_M - WING_PLATE_M))
    tanks = [
        sphere((sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M), TANK_RADIUS_M, 8, "full")
        for sx, sy in itertools.product((-1, 1), repeat=2)
    ]
    exit_z = ENGINE_TOP_M - ENGINE_LENGTH_M
    return [
        prism(octagon(CORE_INSET_M), BODY_TOP_M),
        *both_sides(wing, 1),
        *tanks,
        cone((0, 0, exit_z), (0, 0, 0.0), ENGINE_EXIT_M, 0.05, 6),
        cone((0, 0, BODY_TOP_M - 0.01), (0, 0, PORT_TOP_M), 0.23, 0.23, 6),
    ]


def _lumps() -> list[MassElement]:
    """Return 750 kg: propellant 460 and tanks 40 in four places, body 170, deck and docking 35, engine 20, wings 25."""
    lumps = [
        MassElement(
            "tank",
            125.0,
            (sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M),
            # a cube with a sphere's inertia: side = 2 r sqrt(3/5)
            size_m=vec3(np.full(3, 2 * TANK_RADIUS_M * 0.6**0.5)),
        )
        for sx, sy in itertools.product((-1, 1), repeat=2)
    ]
    lumps += [
        MassElement("body", 170.0, (0, 0, 0.55), size_m=(1.4, 1.4, 0.95)),
        MassElement("deck and docking", 35.0, (0, 0, BODY_TOP_M), size_m=(1.2, 1.2, 0.2)),
        MassElement("engine", 20.0, (0, 0, -0.2), size_m=(0.3, 0.3, 0.5)),
    ]
    lumps += [
        MassElement("wing", 12.5, (0, s * WING_Y_M, WING_Z_M), size_m=(1.24, 1.24, 0.02)) for s in (-1, 1)
    ]
    return lumps
