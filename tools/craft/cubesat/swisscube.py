"""A one-unit CubeSat after SwissCube: cells on five faces, an antenna board with two deployed monopoles below.

SwissCube (EPFL, launched 2009): 0.82 kg, 100 x 100 x 113.5 mm, antennas of 180 mm (UHF) and 610 mm (VHF), two
cells on each of five faces, an airglow telescope (Noca et al., Lessons learned from the first Swiss pico-satellite:
SwissCube, 23rd AIAA/USU Conference on Small Satellites, 2009; eoPortal, SwissCube-1). Places of the fittings are
this model's own. A craft of this size has about 7,000 triangles to show.
"""

from __future__ import annotations

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Target
from tools.craft.assemble import Piece, assemble
from tools.craft.cubesat.fittings import (
    BOARD_GOLD,
    RIM_M,
    face_cells,
    materials,
    onto,
    patch_antenna,
    sun_sensor,
    tape_antenna,
    telescope,
)
from tools.craft.cubesat.structure import RIB_M, U1, body_occluder, corner_keypoints, rail_edges, structure
from tools.craft.hardware import socket_screws
from tools.craft.labels import axis_edge
from tools.craft.level import facets
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box, rod

UHF_M, VHF_M = 0.180, 0.610  # lengths of the antennas
BOARD_M = 0.0032  # thickness of the antenna board
ANTENNA_Z_M = -U1.face_z_m - 0.0022
ROOT_M = 0.040
"""Both antennas leave the board this far from its middle."""
NOTES = (
    "Origin at the middle of the structure, z along the rails, antenna board on -z. Size and antennas after SwissCube; "
    "mass split and fittings estimated."
)
UHF_TIP: Vec3 = (ROOT_M + UHF_M, 0.030, ANTENNA_Z_M)
VHF_TIP: Vec3 = (-0.030, ROOT_M + VHF_M, ANTENNA_Z_M)


def build_cubesat_1u(detail: Detail = "full") -> Target:
    """Return the SwissCube-like craft."""
    keypoints = corner_keypoints(U1)
    keypoints |= {
        "uhf_tip": UHF_TIP,
        "vhf_tip": VHF_TIP,
        "uhf_root": (ROOT_M, 0.030, ANTENNA_Z_M),
        "vhf_root": (-0.030, ROOT_M, ANTENNA_Z_M),
        "telescope_rim": (0.0, 0.0165, -U1.face_z_m - BOARD_M - RIM_M),
    }
    return assemble(
        "cubesat-1u",
        "CubeSat of one unit, after SwissCube, antennas deployed",
        pieces=_pieces(detail),
        materials=materials(BOARD_GOLD),
        keypoints=keypoints,
        wireframe=[
            *rail_edges(U1),
            axis_edge("uhf", (ROOT_M, 0.030, ANTENNA_Z_M), UHF_TIP, 0.0025),
            axis_edge("vhf", (-0.030, ROOT_M, ANTENNA_Z_M), VHF_TIP, 0.0025),
        ],
        occluders=[body_occluder(U1), *_antenna_bodies()],
        lumps=_lumps(),
        frames={
            "grasp": ((0.0, 0.0, U1.z_m / 2), (0.0, 0.0, 1.0)),
            "telescope": ((0.0, 0.0, -U1.face_z_m - BOARD_M), (0.0, 0.0, -1.0)),
        },
        # a cube with like faces: quarter turns about z, but for the antennas
        symmetry=((0.5**0.5, 0.0, 0.0, 0.5**0.5), (0.0, 0.0, 0.0, 1.0), (0.5**0.5, 0.0, 0.0, -(0.5**0.5))),
        notes=NOTES,
    )


def _pieces(detail: Detail) -> list[Piece]:
    pieces = structure(U1, detail, screws_z_m=(-0.0434, 0.0434), screws_lift_m=RIB_M)
    sides = {
        "px": ((U1.face_x_m, 0.0, 0.0), (1, 0, 0)),
        "nx": ((-U1.face_x_m, 0.0, 0.0), (-1, 0, 0)),
        "py": ((0.0, U1.face_y_m, 0.0), (0, 1, 0)),
        "ny": ((0.0, -U1.face_y_m, 0.0), (0, -1, 0)),
        "pz": ((0.0, 0.0, U1.face_z_m), (0, 0, 1)),
    }
    for name, (origin, normal) in sides.items():
        pieces += onto(face_cells(f"face_{name}", 2, 1, detail), origin, normal)
        position = (0.0, 0.0434, 0.0)
        if name != "pz":
            sensor = [
                Piece(p.name, p.material, p.mesh.moved(position)) for p in sun_sensor("sun_sensors", detail)
            ]
            pieces += onto(sensor, origin, normal)
    return pieces + _antenna_board(detail)


def _antenna_board(detail: Detail) -> list[Piece]:
    """Return the board below: guides round which the tapes were wound, the telescope, a switch and connectors."""
    z = -U1.face_z_m
    pieces = [
        Piece("antenna_board", "panel-board", box((-0.041, -0.041, z - 0.0010), (0.041, 0.041, z))),
        Piece("antenna_carrier", "wing-back", box((-0.022, -0.022, z - BOARD_M), (0.022, 0.022, z - 0.001))),
        tape_antenna("antenna_uhf", (ROOT_M - 0.006, 0.030, ANTENNA_Z_M), UHF_TIP, (0, 1, 0)),
        tape_antenna("antenna_vhf", (-0.030, ROOT_M - 0.006, ANTENNA_Z_M), VHF_TIP, (1, 0, 0)),
        Piece(
            "antenna_clamps",
            "wing-back",
            merge(
                [
                    box((0.030, 0.0265, z - 0.0055), (0.0405, 0.0335, z - 0.001)),
                    box((-0.0335, 0.030, z - 0.0055), (-0.0265, 0.0405, z - 0.001)),
                ]
            ),
        ),
        *onto(telescope("telescope", 0.015, 0.0040, detail), (0.0, 0.0, z - BOARD_M), (0, 0, -1)),
        *onto(patch_antenna("beacon", 0.012), (0.004, 0.031, z - 0.001), (0, 0, -1)),
    ]
    if detail != "low":
        n = facets(detail, 24)
        posts = [
            rod((x, y, z - 0.001), (x, y, z - 0.0050), 0.0035, n)
            for x in (-0.033, 0.033)
            for y in (-0.033, 0.014)
        ]
        pieces.append(Piece("antenna_guides", "wing-back", merge(posts)))
    if detail == "full":
        points = [(x, y, z - 0.001) for x in (-0.037, 0.037) for y in (-0.037, 0.037)]
        pieces.append(
            Piece(
                "antenna_screws", "bare-aluminium", socket_screws(points, (0, 0, -1), 0.0016, 0.0009, detail)
            )
        )
        pins = [
            box((x, -0.036, z - 0.004), (x + 0.0007, -0.0353, z - 0.001))
            for x in (-0.012, -0.009, -0.006, -0.003, 0.0, 0.003, 0.006, 0.009)
        ]
        pieces.append(Piece("connector_pins", "busbar", merge(pins)))
    return pieces


def _antenna_bodies() -> list[Mesh]:
    return [
        box((ROOT_M, 0.0298, ANTENNA_Z_M - 0.0025), (ROOT_M + UHF_M, 0.0302, ANTENNA_Z_M + 0.0025)),
        box((-0.0302, ROOT_M, ANTENNA_Z_M - 0.0025), (-0.0298, ROOT_M + VHF_M, ANTENNA_Z_M + 0.0025)),
    ]


def _lumps() -> list[MassElement]:
    """Return 0.82 kg: frame 0.24, boards and battery 0.36, faces with cells 0.13, antenna board and payload 0.09."""
    return [
        MassElement("frame", 0.24, (0, 0, 0), size_m=(0.1, 0.1, 0.1135)),
        MassElement("boards and battery", 0.362, (0, 0, 0.004), size_m=(0.085, 0.085, 0.07)),
        MassElement("faces", 0.13, (0, 0, 0.003), size_m=(0.098, 0.098, 0.1)),
        MassElement("antenna board", 0.08, (0, 0, -0.045), size_m=(0.08, 0.08, 0.02)),
        MassElement("UHF tape", 0.002, (ROOT_M, 0.030, ANTENNA_Z_M), tip_m=UHF_TIP),
        MassElement("VHF tape", 0.006, (-0.030, ROOT_M, ANTENNA_Z_M), tip_m=VHF_TIP),
    ]
