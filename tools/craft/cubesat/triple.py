"""A three-unit CubeSat with two deployed wings: telescope at one end, antennas at the other.

Rails and size: CubeSat Design Specification rev. 14.1. Wings of two hinged panels along the long edges of +y, a
telescope that looks along -z, four deployed tape antennas and patches on +z: the common layout of commercial 3U
Earth observers (compare Planet's Doves and the platforms of GomSpace, ISISPACE and EnduroSat). Places of the fittings
are this model's own; 4 kg is the older limit for 3U and a common flight mass.
"""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
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
    tape_antenna,
    telescope,
)
from tools.craft.cubesat.structure import U3, body_occluder, corner_keypoints, rail_edges, structure
from tools.craft.cubesat.wings import Wings
from tools.craft.hardware import star_tracker
from tools.craft.labels import axis_edge, rim_point, ring_edges
from tools.craft.level import facets
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import circle, rectangle
from tools.craft.shapes.prism import prism as plate
from tools.craft.shapes.solids import box, rod

WINGS = Wings(
    root_x_m=U3.x_m / 2,
    # the hinges are on the rails of +y
    y_m=U3.y_m / 2 + 0.0045,
    panels=2,
    size_m=(0.0840, 0.3270),
    gap_m=0.0040,
)
TAPE_M = 0.170  # length of an antenna
TELESCOPE_M = 0.042  # radius of the telescope's aperture
END_M = U3.face_z_m
NOTES = (
    "Origin at the middle of the structure, z along the rails; telescope on -z, wings in the plane of +y. Mass "
    "split and fittings estimated."
)
TAPE_ROOTS: tuple[Vec3, ...] = tuple(
    (sx * 0.030, sy * 0.030, END_M + 0.0045) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))
)


def tape_tip(k: int) -> Vec3:
    """Return the tip of tape antenna ``k``: diagonally outwards and 15 degrees up."""
    x, y, z = TAPE_ROOTS[k]
    flat, rise = TAPE_M * np.cos(np.deg2rad(15)), TAPE_M * np.sin(np.deg2rad(15))
    return (float(x + np.sign(x) * flat * 0.5**0.5), float(y + np.sign(y) * flat * 0.5**0.5), float(z + rise))


SCREWS_Z_M = (-0.152, -0.063, -0.046, 0.046, 0.063, 0.152)
"""Rows of screws on the sides, in the gaps between cells and ribs."""


def build_cubesat_3u(detail: Detail = "full") -> Target:
    """Return the 3U craft, wings and antennas deployed."""
    keypoints = corner_keypoints(U3)
    keypoints |= WINGS.corners()
    keypoints |= {f"tape_{k + 1}_tip": tape_tip(k) for k in range(4)}
    keypoints |= {
        f"telescope_rim_{k}": rim_point((0, 0, -END_M - RIM_M), (0, 0, -1), 1.10 * TELESCOPE_M, k)
        for k in range(4)
    }
    return assemble(
        "cubesat-3u",
        "CubeSat of three units, two deployed wings",
        pieces=_pieces(detail),
        materials=materials(BOARD_BLACK),
        keypoints=keypoints,
        wireframe=_wireframe(),
        occluders=[body_occluder(U3), *WINGS.bodies()],
        lumps=_lumps(),
        frames={
            "grasp": ((0.0, -U3.y_m / 2, 0.0), (0.0, -1.0, 0.0)),
            "telescope": ((0.0, 0.0, -END_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 1.0, 0.0),),
        notes=NOTES,
    )


def _pieces(detail: Detail) -> list[Piece]:
    fx, fy = U3.face_x_m, U3.face_y_m
    pieces = structure(U3, detail, rings_z_m=(-0.0553, 0.0553), screws_z_m=SCREWS_Z_M)
    for name, origin, normal in (("nx", (-fx, 0.0, 0.0), (-1, 0, 0)), ("px", (fx, 0.0, 0.0), (1, 0, 0))):
        for z in (-0.1075, 0.0, 0.1075):
            position = (origin[0], 0.0, z)
            pieces += onto(face_cells(f"face_{name}", 2, 1, detail), position, normal)
    for z in (-0.1075, 0.0, 0.1075):
        pieces += onto(face_cells("face_py", 2, 1, detail), (0.0, fy, z), (0, 1, 0))
    return [*pieces, *WINGS.pieces(detail), *_front(detail), *_rear(detail), *_radiator_side(detail)]


def _front(detail: Detail) -> list[Piece]:
    """Return the end with the telescope."""
    pieces = onto(telescope("telescope", TELESCOPE_M, 0.0060, detail), (0.0, 0.0, -END_M), (0, 0, -1))
    if detail == "full":
        r, z = TELESCOPE_M * 0.95, -END_M
        spider = [
            box((-0.001, -r, z - 0.0055), (0.001, r, z - 0.0040)),
            box((-r, -0.001, z - 0.0053), (r, 0.001, z - 0.0042)),
            rod((0, 0, z - 0.0038), (0, 0, z - 0.0058), 0.012, facets(detail, 32)),
        ]
        pieces.append(Piece("telescope_spider", "black-paint", merge(spider)))
    return pieces


def _rear(detail: Detail) -> list[Piece]:
    """Return the end with the antennas: a frame that held the tapes, patches, sun sensor, kill switches."""
    z = END_M
    board = plate(
        rectangle((-0.040, -0.040), (0.040, 0.040)),
        0.0060,
        holes=[circle((0, 0), 0.026, facets(detail, 48))],
        origin_m=(0, 0, z),
    )
    pieces = [
        Piece("antenna_frame", "wing-back", board),
        *onto(patch_antenna("s_band_patch", 0.034), (0.0, 0.0, z), (0, 0, 1)),
    ]
    for k, root in enumerate(TAPE_ROOTS):
        pieces.append(tape_antenna(f"tape_{k + 1}", root, tape_tip(k), (-root[1], root[0], 0.0)))
    for x, y in ((0.034, 0.0), (-0.034, 0.0)):
        pieces += onto(sun_sensor("sun_sensors", detail), (x, y, z + 0.006), (0, 0, 1))
    return pieces


def _radiator_side(detail: Detail) -> list[Piece]:
    """Return the -y side: a white radiator, a star tracker's opening, the access port, a GNSS patch."""
    y = -U3.face_y_m
    pieces = [
        Piece("radiator", "white-paint", box((-0.038, y - 0.0008, -0.140), (0.038, y, -0.010))),
        Piece("access_port", "end-plate", box((-0.030, y - 0.0010, 0.075), (0.030, y, 0.140))),
        Piece("access_cover", "black-paint", box((-0.022, y - 0.0016, 0.095), (0.012, y - 0.0005, 0.125))),
        *onto(patch_antenna("gnss_patch", 0.025), (-0.020, y, 0.040), (0, -1, 0)),
        *star_tracker("star_tracker", (0.020, y + 0.001, 0.036), (0, -1, 0), 0.015, 0.0075, detail),
    ]
    if detail == "full":
        louvres = [
            box((-0.037, y - 0.0012, z - 0.0006), (0.037, y - 0.0007, z + 0.0006))
            for z in np.linspace(-0.134, -0.016, 14)
        ]
        pieces.append(Piece("radiator_seams", "grey-paint", merge(louvres)))
    return pieces


def _wireframe() -> list[Edge]:
    edges = [*rail_edges(U3), *WINGS.edges()]
    edges += ring_edges("telescope", (0, 0, -END_M - RIM_M), (0, 0, -1), 1.10 * TELESCOPE_M, 64)
    edges += [axis_edge(f"tape_{k + 1}", TAPE_ROOTS[k], tape_tip(k), 0.0025) for k in range(4)]
    return edges


def _lumps() -> list[MassElement]:
    """Return 4.0 kg: structure 0.75, avionics and battery 1.35, telescope 1.15, wings 0.5, rest 0.25."""
    return [
        MassElement("structure", 0.75, (0, 0, 0), size_m=(0.1, 0.1, 0.3405)),
        MassElement("avionics", 1.35, (0, 0, 0.085), size_m=(0.09, 0.09, 0.15)),
        MassElement("telescope", 1.15, (0, 0, -0.085), size_m=(0.09, 0.09, 0.15)),
        MassElement("face cells", 0.22, (0, 0.01, 0), size_m=(0.098, 0.098, 0.32)),
        *WINGS.lumps(0.25),
        MassElement("antennas", 0.03, (0, 0, END_M), size_m=(0.2, 0.2, 0.01)),
    ]
