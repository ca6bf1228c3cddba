"""Fittings of CubeSats: cells on their faces, wings, antennas, cameras, thrusters, sensors."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail, Material
from tools.craft.assemble import Piece
from tools.craft.finishes import FINISHES
from tools.craft.hardware import cup, tape, tube
from tools.craft.level import facets
from tools.craft.place import placed_pieces
from tools.craft.shapes.mesh import merge, unit
from tools.craft.shapes.solids import box, cone, rod
from tools.craft.solar import CellField, busbars, cells

CELL_X_M, CELL_Y_M = 0.040, 0.080
"""A large triple-junction cell as sold for CubeSats (Azur Space 3G28 and 3G30: 40 x 80 mm, two corners cut)."""
CELL_PITCH_M = 0.0408  # spacing of the solar cells
WING_M = 0.0016  # thickness of a wing panel
RIM_M = 0.0022
"""Height of the bright ring round a telescope's baffle."""

HARD_ANODISED = Material(name="hard-anodised", base_color=(0.42, 0.42, 0.43), metallic=0.4, roughness=0.45)
BOARD_GREEN = Material(name="panel-board", base_color=(0.030, 0.075, 0.045), roughness=0.5, clearcoat=0.3)
BOARD_BLACK = Material(name="panel-board", base_color=(0.035, 0.035, 0.037), roughness=0.5, clearcoat=0.3)
BOARD_GOLD = Material(name="panel-board", base_color=(0.44, 0.30, 0.10), metallic=0.35, roughness=0.45)
END_PLATE = Material(name="end-plate", base_color=(0.58, 0.58, 0.59), metallic=0.5, roughness=0.42)
PATCH = Material(name="patch-ceramic", base_color=(0.62, 0.56, 0.46), roughness=0.45)
WHITE_BOARD = Material(name="wing-back", base_color=(0.66, 0.66, 0.63), roughness=0.55)


def materials(board: Material) -> tuple[Material, ...]:
    """Return all materials of a CubeSat, with the finish of its panel boards."""
    return (*FINISHES, HARD_ANODISED, board, END_PLATE, PATCH, WHITE_BOARD)


def face_cells(
    name: str, columns: int, rows: int, detail: Detail, *, pitch_y_m: float = CELL_Y_M + 0.0008
) -> list[Piece]:
    """Return the cells with busbars about the origin, for a face or a wing: the long side of a cell along y."""
    field = CellField(
        columns=columns,
        rows=rows,
        pitch_x_m=CELL_PITCH_M,
        pitch_y_m=pitch_y_m,
        gap_m=0.0008,
        clip_m=0.0065,
        height_m=0.0006,
    )
    pieces = [Piece(f"{name}_cells", "solar-cell", cells(field, 0.0, detail))]
    ribbons = busbars(field, 0.0, 0.0007, detail)
    if ribbons:
        pieces.append(Piece(f"{name}_busbars", "busbar", merge(ribbons)))
    return pieces


def wing(
    name: str, panels: int, columns: int, rows: int, size_m: tuple[float, float], gap_m: float, detail: Detail
) -> list[Piece]:
    """Return a wing of hinged panels along +x from the hinge line at x = 0, cells up, upper face at z = 0."""
    pieces = []
    for k in range(panels):
        x = gap_m + size_m[0] / 2 + k * (size_m[0] + gap_m)
        board = box((-size_m[0] / 2, -size_m[1] / 2, -WING_M), (size_m[0] / 2, size_m[1] / 2, 0.0))
        group = [Piece(f"{name}_boards", "panel-board", board), *face_cells(name, columns, rows, detail)]
        pieces += placed_pieces(group, (x, 0, 0), (1, 0, 0), (0, 1, 0))
        if detail == "low":
            continue
        for y in (-0.35 * size_m[1], 0.35 * size_m[1]):
            # a spring hinge at the root of each panel
            root = x - size_m[0] / 2 - gap_m / 2
            pin = rod((root, y - 0.009, -0.0022), (root, y + 0.009, -0.0022), 0.0018, facets(detail, 12))
            pieces.append(Piece(f"{name}_hinges", "bare-aluminium", pin))
    return pieces


def wing_width_m(panels: int, size_x_m: float, gap_m: float) -> float:
    """Return the reach of a wing from its hinge line [m]."""
    return panels * (size_x_m + gap_m)


def sun_sensor(name: str, detail: Detail) -> list[Piece]:
    """Return a square sensor with a dark window, on the plane z = 0."""
    return [
        Piece(f"{name}_bodies", "grey-paint", box((-0.006, -0.006, 0), (0.006, 0.006, 0.0028))),
        Piece(f"{name}_windows", "lens", box((-0.0033, -0.0033, 0.0), (0.0033, 0.0033, 0.0031))),
    ] + (
        [Piece(f"{name}_rims", "busbar", tube((0, 0, 0.0027), (0, 0, 1), 0.0052, 0.0047, 0.0003, 24, detail))]
        if detail == "full"
        else []
    )


def patch_antenna(name: str, side_m: float) -> list[Piece]:
    """Return a ceramic patch with its metal square."""
    a, b = side_m / 2, 0.36 * side_m
    return [
        Piece(f"{name}_ceramic", "patch-ceramic", box((-a, -a, 0), (a, a, 0.0035))),
        Piece(f"{name}_metal", "busbar", box((-b, -b, 0.003), (b, b, 0.0038))),
    ]


def telescope(name: str, radius_m: float, height_m: float, detail: Detail) -> list[Piece]:
    """Return a baffled aperture that looks along +z from the plane z = 0: a black pot with a lens on its floor."""
    floor = 0.0015
    baffle = cup((0, 0, -0.001), (0, 0, 1), radius_m, 0.93 * radius_m, height_m + 0.001, 0.0015, 64, detail)
    rim = tube((0, 0, -0.0005), (0, 0, 1), 1.10 * radius_m, 0.99 * radius_m, RIM_M + 0.0005, 64, detail)
    glass = cone((0, 0, 0.0003), (0, 0, floor), 0.75 * radius_m, 0.75 * radius_m, facets(detail, 48))
    pieces = [
        Piece(f"{name}_baffle", "black-paint", baffle),
        Piece(f"{name}_rim", "bare-aluminium", rim),
        Piece(f"{name}_lens", "lens", glass),
    ]
    if detail == "full":
        vanes = [
            tube((0, 0, h), (0, 0, 1), 0.94 * radius_m, 0.84 * radius_m, 0.0004, 64, detail)
            for h in np.linspace(0.45, 0.9, 3) * height_m
        ]
        pieces.append(Piece(f"{name}_vanes", "black-paint", merge(vanes)))
    return pieces


def tape_antenna(
    name: str, root_m: tuple[float, float, float], tip_m: tuple[float, float, float], face: tuple[float, ...]
) -> Piece:
    """Return a steel tape of 5 mm, its flat side along ``face``."""
    return Piece(name, "spring-steel", merge(tape(root_m, tip_m, 0.0050, 0.0003, face)))


def onto(
    pieces: list[Piece], origin_m: tuple[float, float, float], normal: tuple[int, int, int]
) -> list[Piece]:
    """Return the pieces that lie on z = 0, put on a face: their y axis along the craft's z (or y, on an end)."""
    n = np.array(normal, float)
    v = np.array([0.0, 1.0, 0.0]) if abs(n[2]) > 0 else np.array([0.0, 0.0, 1.0])
    return placed_pieces(pieces, origin_m, unit(np.cross(v, n)), v)
