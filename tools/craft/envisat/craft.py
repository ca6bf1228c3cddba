"""Envisat assembled: parts, labels, coarse bodies and mass distribution."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Edge, Material, Target
from tools.craft.assemble import assemble
from tools.craft.envisat.dimensions import (
    ARRAY_GAP_M,
    ARRAY_HALF_Y_M,
    ARRAY_LENGTH_M,
    ARRAY_PLATE_M,
    ARRAY_ROOT_X_M,
    ARRAY_U,
    ARRAY_V,
    ASAR_CENTRE,
    ASAR_HALF_WIDTH_M,
    ASAR_HALF_Y_M,
    ASAR_PLATE_M,
    ASAR_U,
    ASAR_V,
    BUS_END_X_M,
    BUS_HALF_Y_M,
    BUS_HALF_Z_M,
    DISH_DEPTH_M,
    DISH_RADIUS_M,
    DISH_X_M,
    KA_MAST_X_M,
    KA_RADIUS_M,
    KA_TOP_M,
    RING_M,
    RING_RADIUS_M,
    SERVICE_END_X_M,
)
from tools.craft.envisat.instruments import EARTH_M, KA_AXIS, KA_DEPTH_M, KA_VERTEX, build_instruments
from tools.craft.envisat.structure import build_bus
from tools.craft.envisat.wings import build_array, build_asar
from tools.craft.finishes import FINISHES
from tools.craft.labels import axis_edge, box_edges, prism_edges, rim_point, ring_edges
from tools.craft.mass import MassElement
from tools.craft.place import placed, placed_point
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.prism import rectangle
from tools.craft.shapes.solids import box, cone
from tools.craft.tango.labels import CORNERS

TILE = Material(name="asar-tile", base_color=(0.62, 0.60, 0.55), roughness=0.55)
NOTES = (
    "Origin at the launcher interface, x along the long axis towards the array, z to the Earth. Sizes of bus, array "
    "and ASAR antenna as published by ESA; instruments after its drawings by eye; mass split fitted to the totals "
    "that debris-removal studies publish."
)
ARRAY_X_M = (ARRAY_ROOT_X_M + ARRAY_GAP_M / 2, ARRAY_ROOT_X_M + ARRAY_LENGTH_M - ARRAY_GAP_M / 2)


def build_envisat(detail: Detail = "full") -> Target:
    """Return the craft as debris: array and antenna deployed."""
    return assemble(
        "envisat",
        "Envisat-like debris",
        pieces=[*build_bus(detail), *build_array(detail), *build_asar(detail), *build_instruments(detail)],
        materials=(*FINISHES, TILE),
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "launcher_ring": ((RING_M, 0.0, 0.0), (1.0, 0.0, 0.0)),
            "payload_end": ((BUS_END_X_M, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        },
        notes=NOTES,
    )


def _array_point(x: float, y: float) -> Vec3:
    return placed_point((x, y, 0.0), (0, 0, 0), ARRAY_U, ARRAY_V)


def _asar_point(x: float, y: float) -> Vec3:
    return placed_point((x, y, 0.0), ASAR_CENTRE, ASAR_U, ASAR_V)


def _keypoints() -> dict[str, Vec3]:
    y, z = BUS_HALF_Y_M, BUS_HALF_Z_M
    points: dict[str, Vec3] = {}
    for b, c, sy, sz in CORNERS:
        b_name, c_name = b.replace("x", "y"), c.replace("y", "z")
        points[f"payload_end_{b_name}_{c_name}"] = (BUS_END_X_M + 0.001, sy * y, sz * z)
    for b, c, sy, sz in CORNERS:
        b_name, c_name = b.replace("x", "y"), c.replace("y", "z")
        points[f"module_joint_{b_name}_{c_name}"] = (SERVICE_END_X_M - 0.001, sy * y, sz * z)
    for a, x in (("root", ARRAY_X_M[0]), ("tip", ARRAY_X_M[1])):
        points[f"array_{a}_ny"] = _array_point(x, ARRAY_HALF_Y_M)
        points[f"array_{a}_py"] = _array_point(x, -ARRAY_HALF_Y_M)
    for b, sy in (("ny", -1), ("py", 1)):
        points[f"asar_{b}_nx"] = _asar_point(sy * ASAR_HALF_Y_M, ASAR_HALF_WIDTH_M)
        points[f"asar_{b}_px"] = _asar_point(sy * ASAR_HALF_Y_M, -ASAR_HALF_WIDTH_M)
    for k in range(4):
        points[f"ring_{k}"] = rim_point((RING_M, 0, 0), (1, 0, 0), RING_RADIUS_M, k)
    rim = (DISH_X_M, 0.0, EARTH_M + 0.24 + DISH_DEPTH_M)
    for k in range(4):
        points[f"ra2_rim_{k}"] = rim_point(rim, (0, 0, 1), DISH_RADIUS_M, k)
    ka = np.asarray(KA_VERTEX) + KA_DEPTH_M * np.asarray(KA_AXIS)
    points |= {f"ka_rim_{k}": rim_point(ka, KA_AXIS, KA_RADIUS_M, k) for k in range(4)}
    return points


def _wireframe() -> list[Edge]:
    edges = box_edges(
        "bus",
        (BUS_END_X_M + 0.001, -BUS_HALF_Y_M, -BUS_HALF_Z_M),
        (SERVICE_END_X_M, BUS_HALF_Y_M, BUS_HALF_Z_M),
    )
    # the end frames are hidden under boxes and blankets: the beams' long edges are what one sees
    edges = [e for e in edges if "x" not in e.name.removeprefix("bus")]
    x0, x1 = ARRAY_X_M
    outline = rectangle((x0, -ARRAY_HALF_Y_M), (x1, ARRAY_HALF_Y_M))
    n = np.cross(ARRAY_U, ARRAY_V)
    edges += prism_edges("array", outline, ARRAY_PLATE_M, origin_m=-ARRAY_PLATE_M * n, u=ARRAY_U, v=ARRAY_V)
    outline = rectangle((-ASAR_HALF_Y_M, -ASAR_HALF_WIDTH_M), (ASAR_HALF_Y_M, ASAR_HALF_WIDTH_M))
    n = np.cross(ASAR_U, ASAR_V)
    origin = np.asarray(ASAR_CENTRE) - ASAR_PLATE_M * n
    edges += prism_edges("asar", outline, ASAR_PLATE_M, origin_m=origin, u=ASAR_U, v=ASAR_V)
    edges += ring_edges("ring", (RING_M, 0, 0), (1, 0, 0), RING_RADIUS_M, 96)
    rim = (DISH_X_M, 0.0, EARTH_M + 0.24 + DISH_DEPTH_M)
    edges += ring_edges("ra2", rim, (0, 0, 1), DISH_RADIUS_M, 64)
    ka = np.asarray(KA_VERTEX) + KA_DEPTH_M * np.asarray(KA_AXIS)
    edges += ring_edges("ka", ka, KA_AXIS, KA_RADIUS_M, 48)
    edges.append(
        axis_edge("ka_mast", (KA_MAST_X_M, 0.75, -BUS_HALF_Z_M), (KA_MAST_X_M, 0.75, -KA_TOP_M + 0.3), 0.06)
    )
    return edges


def _occluders() -> list[Mesh]:
    x0, x1 = ARRAY_X_M
    array = box((x0, -ARRAY_HALF_Y_M, -ARRAY_PLATE_M), (x1, ARRAY_HALF_Y_M, 0.0))
    asar = box((-ASAR_HALF_Y_M, -ASAR_HALF_WIDTH_M, -ASAR_PLATE_M), (ASAR_HALF_Y_M, ASAR_HALF_WIDTH_M, 0.0))
    y, z = BUS_HALF_Y_M, BUS_HALF_Z_M
    e = EARTH_M
    return [
        box((BUS_END_X_M, -y, -z), (-0.02, y, z)),
        placed(array, (0, 0, 0), ARRAY_U, ARRAY_V),
        placed(asar, ASAR_CENTRE, ASAR_U, ASAR_V),
        cone((-0.01, 0, 0), (RING_M, 0, 0), RING_RADIUS_M * 0.99, RING_RADIUS_M * 0.99, 12),
        cone((DISH_X_M, 0, e), (DISH_X_M, 0, e + 0.43), 0.25, 0.58, 12),
        box((-8.05, -1.15, e), (-7.30, -0.25, e + 0.55)),
        box((-9.75, -1.20, e), (-8.60, -0.35, e + 0.60)),
        box((BUS_END_X_M + 0.05, -0.55, -e - 0.62), (BUS_END_X_M + 1.45, 0.65, -e)),
        box((BUS_END_X_M + 0.10, y - 0.02, -0.45), (BUS_END_X_M + 0.95, y + 0.48, 0.35)),
        box((BUS_END_X_M + 0.15, -y - 0.42, -0.40), (BUS_END_X_M + 1.10, -y + 0.02, 0.45)),
    ]


def _lumps() -> list[MassElement]:
    """Return 7,828 kg, split so that centre of mass and inertia come near the published ones.

    ESA's debris-removal studies (e.Deorbit) quote for the dead craft x = -3.9 m of the centre of mass, and 17,000,
    125,000 and 129,000 kg m2 about x, y and z.
    """
    y, z = 2 * BUS_HALF_Y_M, 2 * BUS_HALF_Z_M
    wing = 2 * ARRAY_HALF_Y_M
    return [
        MassElement("service module", 2700.0, (-1.35, 0, 0), size_m=(2.5, y, z)),
        MassElement("payload module", 2700.0, (-5.4, 0, 0), size_m=(5.4, y, z)),
        MassElement("end instruments", 800.0, (-9.3, 0, -0.25), size_m=(1.3, 3.4, 1.9)),
        MassElement("Earth side instruments", 480.0, (-7.6, -0.2, 1.0), size_m=(3.8, 2.0, 0.5)),
        MassElement("ASAR antenna", 780.0, ASAR_CENTRE, size_m=(1.3, 10.0, 0.2)),
        MassElement("solar array", 338.0, (8.6, 0, 0), size_m=(14.8, wing, 0.05)),
        MassElement("Ka-band antenna", 30.0, (KA_MAST_X_M, 0.75, -2.0), size_m=(0.8, 0.8, 0.8)),
    ]
