"""A six-unit CubeSat with two wings of three panels: a camera, a star tracker and a cold-gas thruster module.

Rails and size: CubeSat Design Specification rev. 14.1 (226.3 x 100 x 366 mm). Wings as on commercial 6U platforms,
folded against the narrow sides and deployed into the plane of +y; a flat patch array on +z as on NASA's MarCO (Hodges
et al., A deployable high-gain antenna bound for Mars, IEEE Antennas and Propagation Magazine 59(2), 2017, describes
its bus). Places of the fittings are this model's own; 10 kg is a common flight mass.
"""

from __future__ import annotations

import itertools

import numpy as np

from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import Piece, assemble
from tools.craft.cubesat.fittings import (
    BOARD_BLACK,
    RIM_M,
    face_cells,
    materials,
    onto,
    patch_antenna,
    sun_sensor,
    telescope,
)
from tools.craft.cubesat.structure import U6, body_occluder, corner_keypoints, rail_edges, structure
from tools.craft.cubesat.wings import Wings
from tools.craft.hardware import star_tracker, thruster
from tools.craft.labels import prism_edges, rim_point, ring_edges
from tools.craft.level import facets
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import rectangle
from tools.craft.shapes.solids import box, cone

WINGS = Wings(
    root_x_m=U6.x_m / 2,
    # the hinges are on the rails of +y
    y_m=U6.y_m / 2 + 0.0045,
    panels=3,
    size_m=(0.0850, 0.3280),
    gap_m=0.0050,
)
CAMERA_M, CAMERA_X_M = 0.040, -0.055
TRACKER_X_M = 0.062
END_M = U6.face_z_m
ARRAY_LOW_M, ARRAY_HIGH_M = (-0.098, -0.038, END_M), (0.010, 0.038, END_M + 0.005)
NOTES = (
    "Origin at the middle of the structure, z along the rails; camera on -z, thrusters and patch array on +z, wings in "
    "the plane of +y. Mass split and fittings estimated."
)


def build_cubesat_6u(detail: Detail = "full") -> Target:
    """Return the 6U craft, wings deployed."""
    keypoints = corner_keypoints(U6)
    keypoints |= WINGS.corners()
    keypoints |= {
        f"camera_rim_{k}": rim_point((CAMERA_X_M, 0, -END_M - RIM_M), (0, 0, -1), 1.10 * CAMERA_M, k)
        for k in range(4)
    }
    keypoints |= {
        f"array_{a}_{b}": (x, y, ARRAY_HIGH_M[2])
        for a, x in (("nx", ARRAY_LOW_M[0]), ("px", ARRAY_HIGH_M[0]))
        for b, y in (("ny", ARRAY_LOW_M[1]), ("py", ARRAY_HIGH_M[1]))
    }
    return assemble(
        "cubesat-6u",
        "CubeSat of six units, two wings of three panels",
        pieces=_pieces(detail),
        materials=materials(BOARD_BLACK),
        keypoints=keypoints,
        wireframe=_wireframe(),
        occluders=[body_occluder(U6), *WINGS.bodies()],
        lumps=_lumps(),
        frames={
            "grasp": ((0.0, -U6.y_m / 2, 0.0), (0.0, -1.0, 0.0)),
            "camera": ((CAMERA_X_M, 0.0, -END_M), (0.0, 0.0, -1.0)),
            "thrust": ((0.060, 0.0, END_M), (0.0, 0.0, 1.0)),
        },
        symmetry=((0.0, 0.0, 1.0, 0.0),),
        notes=NOTES,
    )


def _pieces(detail: Detail) -> list[Piece]:
    pieces = structure(U6, detail, rings_z_m=(-0.061, 0.061), screws_z_m=(-0.0725, -0.0495, 0.0495, 0.0725))
    for z in (-0.1215, 0.0, 0.1215):
        pieces += onto(face_cells("face_py", 5, 1, detail), (0.0, U6.face_y_m, z), (0, 1, 0))
    return [*pieces, *WINGS.pieces(detail), *_front(detail), *_rear(detail), *_sides(detail)]


def _front(detail: Detail) -> list[Piece]:
    """-z: the camera, a star tracker next to it, a GNSS patch, a laser ranger."""
    z = -END_M
    n = facets(detail, 32)
    return [
        *onto(telescope("camera", CAMERA_M, 0.0060, detail), (CAMERA_X_M, 0.0, z), (0, 0, -1)),
        *star_tracker("star_tracker", (TRACKER_X_M, 0.008, z + 0.002), (0, 0, -1), 0.024, 0.0085, detail),
        *onto(patch_antenna("gnss_patch", 0.025), (0.012, 0.028, z), (0, 0, -1)),
        Piece("ranger", "black-paint", box((0.002, -0.040, z - 0.004), (0.030, -0.018, z))),
        Piece(
            "ranger_lens",
            "lens",
            cone((0.016, -0.029, z - 0.0035), (0.016, -0.029, z - 0.005), 0.008, 0.008, n),
        ),
    ]


def _rear(detail: Detail) -> list[Piece]:
    """+z: a patch array and the cold-gas module with four nozzles at its corners and one in the middle."""
    z = END_M
    lo, hi = ARRAY_LOW_M, ARRAY_HIGH_M
    pieces = [
        Piece("array_board", "patch-ceramic", box(lo, hi)),
        Piece(
            "thruster_module",
            "bare-aluminium",
            box((0.022, -0.040, z - 0.001), (0.102, 0.040, z + 0.003), 0.001),
        ),
    ]
    if detail != "low":
        patches = [
            box((x - 0.0105, y - 0.0105, hi[2] - 0.0003), (x + 0.0105, y + 0.0105, hi[2] + 0.0003))
            for x in np.linspace(lo[0] + 0.015, hi[0] - 0.015, 4)
            for y in np.linspace(lo[1] + 0.0145, hi[1] - 0.0145, 3)
        ]
        pieces.append(Piece("array_patches", "busbar", merge(patches)))
    jets = [
        thruster((x, y, z + 0.0025), (0, 0, 1), 0.0055, 0.0095, detail)
        for x, y in ((0.032, -0.030), (0.092, -0.030), (0.092, 0.030), (0.032, 0.030))
    ]
    jets.append(thruster((0.062, 0.0, z + 0.0025), (0, 0, 1), 0.0085, 0.0120, detail))
    return [*pieces, Piece("thrusters", "nozzle", merge(jets))]


def _sides(detail: Detail) -> list[Piece]:
    """Return the radiators and access cover on -y; sun sensors and cells on the narrow sides."""
    y = -U6.face_y_m
    pieces = [
        Piece("radiator", "radiator-mirror", box((-0.098, y - 0.0008, -0.150), (0.000, y, -0.010))),
        Piece("access_cover", "end-plate", box((0.020, y - 0.0010, 0.020), (0.090, y, 0.150))),
        Piece("access_ports", "black-paint", box((0.030, y - 0.0016, 0.105), (0.080, y - 0.0005, 0.140))),
        Piece("payload_hatch", "white-paint", box((0.018, y - 0.0010, -0.150), (0.092, y, -0.030))),
        *onto(patch_antenna("uhf_patch", 0.060), (-0.055, y, 0.080), (0, -1, 0)),
        *onto(sun_sensor("sun_sensors", detail), (0.0, y, 0.1655), (0, -1, 0)),
    ]
    if detail == "full":
        seams = [
            box((x - 0.0004, y - 0.0010, -0.150), (x + 0.0004, y - 0.0007, -0.010))
            for x in np.linspace(-0.088, -0.010, 9)
        ]
        pieces.append(Piece("radiator_seams", "grey-paint", merge(seams)))
    for sx, z in itertools.product((-1, 1), (-0.1215, 0.0, 0.1215)):
        pieces += onto(face_cells("face_x", 2, 1, detail), (sx * U6.face_x_m, 0.0, z), (sx, 0, 0))
    return pieces


def _wireframe() -> list[Edge]:
    edges = [*rail_edges(U6), *WINGS.edges()]
    edges += ring_edges("camera", (CAMERA_X_M, 0, -END_M - RIM_M), (0, 0, -1), 1.10 * CAMERA_M, 64)
    lo, hi = ARRAY_LOW_M, ARRAY_HIGH_M
    array = prism_edges("array", rectangle(lo[:2], hi[:2]), hi[2] - lo[2], origin_m=(0, 0, lo[2]))
    return edges + [e for e in array if "_low_" not in e.name]


def _lumps() -> list[MassElement]:
    """10.0 kg: structure 1.6, avionics and battery 3.4, camera 1.9, cold gas 1.6, wings 1.1, faces 0.4."""
    return [
        MassElement("structure", 1.6, (0, 0, 0), size_m=(0.226, 0.1, 0.366)),
        MassElement("avionics", 3.4, (0.0, 0, 0.01), size_m=(0.2, 0.09, 0.2)),
        MassElement("camera", 1.9, (CAMERA_X_M, 0, -0.1), size_m=(0.09, 0.09, 0.15)),
        MassElement("cold gas", 1.6, (0.060, 0, 0.13), size_m=(0.09, 0.09, 0.09)),
        MassElement("face cells", 0.4, (0, 0.01, 0), size_m=(0.22, 0.098, 0.34)),
        *WINGS.lumps(0.55),
    ]
