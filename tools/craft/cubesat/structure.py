"""A CubeSat's structure: four rails, the plates between them, bolts; and what its labels take from it.

Frame of all CubeSats: origin at the middle of the structure, z along the rails, x across the wide side.

Dimensions: CubeSat Design Specification rev. 14.1 (Cal Poly, 2022), sec. 2.2 and app. B: 1U 100 x 100 x 113.5 mm,
3U 100 x 100 x 340.5 mm, 6U 226.3 x 100 x 366 mm; rails at least 8.5 mm wide, rounded to 1 mm (a 0.9 mm chamfer
here); nothing but rails touches the dispenser, and parts stand at most 6.5 mm proud of the plane of the rails.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Edge
from tools.craft.assemble import Piece
from tools.craft.hardware import socket_screws
from tools.craft.labels import box_edges
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box

RAIL_M = 0.0085  # width of a rail (CubeSat Design Specification)
RAIL_EDGE_M = 0.0009  # rounding of a rail's edges
RAIL_END_M = 0.0065
"""The rails reach this far past the end plates (the specification asks for 6.5 mm of standoff on +z and -z)."""
PLATE_M = 0.0015  # thickness of a side plate
RECESS_M = 0.0012
"""The plates' outer faces lie this far below the plane of the rails."""
RIB_M = 0.0007
"""The ribs across the sides stand this far above the plates."""
CORNERS = (("nx", "ny", -1, -1), ("px", "ny", 1, -1), ("px", "py", 1, 1), ("nx", "py", -1, 1))


@dataclass(frozen=True, kw_only=True)
class RailFrame:
    """Outer size of the rails [m]."""

    x_m: float
    y_m: float
    z_m: float

    @property
    def half(self) -> Vec3:
        """Half of each side [m]."""
        return (self.x_m / 2, self.y_m / 2, self.z_m / 2)

    @property
    def face_x_m(self) -> float:
        """Outer face of the +x plate."""
        return self.x_m / 2 - RECESS_M

    @property
    def face_y_m(self) -> float:
        """Outer face of the +y plate."""
        return self.y_m / 2 - RECESS_M

    @property
    def face_z_m(self) -> float:
        """Outer face of the +z plate."""
        return self.z_m / 2 - RAIL_END_M


U1 = RailFrame(x_m=0.100, y_m=0.100, z_m=0.1135)
U3 = RailFrame(x_m=0.100, y_m=0.100, z_m=0.3405)
U6 = RailFrame(x_m=0.2263, y_m=0.100, z_m=0.3660)


def structure(
    frame: RailFrame,
    detail: Detail,
    *,
    rings_z_m: tuple[float, ...] = (),
    screws_z_m: tuple[float, ...] = (),
    screws_lift_m: float = 0.0,
) -> list[Piece]:
    """Return the rails, plates and bolts.

    Parameters
    ----------
    frame : RailFrame
        Size of the structure.
    detail : Detail
        Level of detail.
    rings_z_m : tuple of float, optional
        Heights of bars across the sides, where the ribs between units show.
    screws_z_m : tuple of float, optional
        Heights of the rows of screws that hold the panel boards, next to the cells.
    screws_lift_m : float, optional
        How far above the boards their heads sit: ``RIB_M`` on the ribs.
    """
    x, y, z = frame.half
    rail = box((x - RAIL_M, y - RAIL_M, -z), (x, y, z), RAIL_EDGE_M if detail == "full" else 0.0)
    rails = [m for a in (rail, rail.mirrored(0)) for m in (a, a.mirrored(1))]
    pieces = [
        Piece("rails", "hard-anodised", merge(rails)),
        Piece("side_plates", "panel-board", merge(_side_plates(frame))),
        Piece("end_plates", "end-plate", merge(_end_plates(frame))),
    ]
    if detail != "low":
        pieces.append(Piece("ribs", "hard-anodised", merge(_ribs(frame, rings_z_m))))
    if detail == "full":
        pieces.append(Piece("bolts", "bare-aluminium", merge(_bolts(frame, detail))))
        pieces.append(
            Piece("panel_screws", "bare-aluminium", merge(_screws(frame, screws_z_m, screws_lift_m, detail)))
        )
    return pieces


def _side_plates(frame: RailFrame) -> list[Mesh]:
    fx, fy, (x, y, _), z = frame.face_x_m, frame.face_y_m, frame.half, frame.face_z_m - 0.004
    px = box((fx - PLATE_M, -y + RAIL_M, -z), (fx, y - RAIL_M, z))
    py = box((-x + RAIL_M, fy - PLATE_M, -z), (x - RAIL_M, fy, z))
    return [px, px.mirrored(0), py, py.mirrored(1)]


def _end_plates(frame: RailFrame) -> list[Mesh]:
    x, y, z = frame.half[0] - RECESS_M, frame.half[1] - RECESS_M, frame.face_z_m
    # a cross in outline: the rails run through its corners
    top = [
        box((-x + RAIL_M, -y, z - 0.004), (x - RAIL_M, y, z)),
        box((x - RAIL_M, -y + RAIL_M, z - 0.004), (x, y - RAIL_M, z)),
        box((-x, -y + RAIL_M, z - 0.004), (-x + RAIL_M, y - RAIL_M, z)),
    ]
    return [*top, *(m.mirrored(2) for m in top)]


def _ribs(frame: RailFrame, rings_z_m: tuple[float, ...]) -> list[Mesh]:
    """Return the bars across the sides, half a millimetre below the rails."""
    x, y, _ = frame.half
    out = RECESS_M - RIB_M
    bars = []
    for z in rings_z_m:
        bar_x = box((x - RECESS_M - 0.001, -y + RAIL_M, z - 0.003), (x - out, y - RAIL_M, z + 0.003))
        bar_y = box((-x + RAIL_M, y - RECESS_M - 0.001, z - 0.003), (x - RAIL_M, y - out, z + 0.003))
        bars += [bar_x, bar_x.mirrored(0), bar_y, bar_y.mirrored(1)]
    edge = frame.face_z_m - 0.004
    for side in (1, -1):
        lo, hi = sorted((side * edge, side * (edge - 0.005)))
        rim_x = box((x - RECESS_M - 0.001, -y + RAIL_M, lo), (x - out, y - RAIL_M, hi))
        rim_y = box((-x + RAIL_M, y - RECESS_M - 0.001, lo), (x - RAIL_M, y - out, hi))
        bars += [rim_x, rim_x.mirrored(0), rim_y, rim_y.mirrored(1)]
    return bars


def _bolts(frame: RailFrame, detail: Detail) -> list[Mesh]:
    """Return the countersunk screws in the rails' sides and in the end plates."""
    x, y, z = frame.half
    heights = np.linspace(-z + 0.012, z - 0.012, max(2, round(frame.z_m / 0.05)))
    a = RAIL_M / 2
    meshes = []
    for sx, sy in itertools.product((-1, 1), repeat=2):
        meshes.append(
            socket_screws([(sx * x, sy * (y - a), h) for h in heights], (sx, 0, 0), 0.0014, 0.0002, detail)
        )
        meshes.append(
            socket_screws([(sx * (x - a), sy * y, h) for h in heights], (0, sy, 0), 0.0014, 0.0002, detail)
        )
        for sz in (-1, 1):
            points = [
                (sx * (x - 0.013), sy * (y - 0.006), sz * frame.face_z_m),
                (sx * (x - 0.006), sy * (y - 0.013), sz * frame.face_z_m),
            ]
            meshes.append(socket_screws(points, (0, 0, sz), 0.0018, 0.0008, detail))
    return meshes


def _screws(frame: RailFrame, heights_m: tuple[float, ...], lift_m: float, detail: Detail) -> list[Mesh]:
    """Return the button heads along the panel boards of all four sides."""
    meshes = []
    for face, width, along in ((frame.face_x_m, frame.y_m, 1), (frame.face_y_m, frame.x_m, 0)):
        offsets = np.linspace(-1, 1, 2 * round(width / 0.05)) * (width / 2 - RAIL_M - 0.0045)
        for side in (-1, 1):
            axis = [0.0, 0.0, 0.0]
            axis[1 - along] = side
            points = []
            for a, z in itertools.product(offsets, heights_m):
                p = [0.0, 0.0, z]
                p[along], p[1 - along] = a, side * (face + lift_m)
                points.append(p)
            meshes.append(socket_screws(points, axis, 0.0013, 0.0006, detail))
    return meshes


def corner_keypoints(frame: RailFrame) -> dict[str, Vec3]:
    """Return the outer corners of the rails' ends: the eight points that a dispenser touches.

    The rails are rounded by a chamfer, so the points lie on the end faces, at the chamfer's corners.
    """
    x, y, z = frame.half
    e = RAIL_EDGE_M
    return {
        f"rail_{a}_{b}_{c}": (sx * (x - e), sy * (y - e), sz * z)
        for c, sz in (("nz", -1), ("pz", 1))
        for a, b, sx, sy in CORNERS
    }


def rail_edges(frame: RailFrame) -> list[Edge]:
    """Return the edges of the four rails: all of the upright ones, and the outlines of their ends."""
    x, y, z = frame.half
    edges = []
    for a, b, sx, sy in CORNERS:
        lo = (min(sx * x, sx * (x - RAIL_M)), min(sy * y, sy * (y - RAIL_M)), -z)
        hi = (max(sx * x, sx * (x - RAIL_M)), max(sy * y, sy * (y - RAIL_M)), z)
        edges += [e for e in box_edges(f"rail_{a}_{b}", lo, hi) if not _inner(e, sx, sy)]
    return edges


def _inner(edge: Edge, sx: int, sy: int) -> bool:
    """Return True if an edge faces the structure's interior."""
    return any(n[0] * sx < 0 or n[1] * sy < 0 for n in edge.normals)


def body_occluder(frame: RailFrame) -> Mesh:
    """Return the whole structure as one box."""
    x, y, z = frame.half
    return box((-x, -y, -z + RAIL_END_M), (x, y, z - RAIL_END_M))
