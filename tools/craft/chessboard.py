"""A flat chessboard for calibration and for checks of the whole camera chain, its squares geometry, not texture.

Eleven by eight squares of 40 mm on a plate of 0.52 x 0.40 m: the same pattern as a printed board with 10 x 7 inner
corners. Model frame: origin at the middle of the face, z out of the face, x right and y up for somebody who reads
the board; the dark square is in the upper left corner. Keypoint ``corner_R_C`` is inner corner C of row R, rows
from the top, columns from the left: the order in which ``cv2.findChessboardCorners(image, (10, 7))`` reports the board,
upright or upside down (of an odd number of squares by an even one the colours tell which end is up);
``cv2.findChessboardCornersSB`` reports the same corners from the last to the first. The board has about 1,200 triangles
and no more to show, so its three levels of detail are the same.
"""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray, Vec3
from flyaround.simulator.targets.model import Detail, Edge, Material, Target, TextureImage
from tools.craft.assemble import Piece, assemble
from tools.craft.finishes import FINISHES
from tools.craft.labels import box_edges, face_edges
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import prism, rectangle
from tools.craft.shapes.solids import box

COLUMNS, ROWS = 11, 8  # squares of the board
SQUARE_M = 0.040  # side of a square
PLATE_X_M, PLATE_Y_M, PLATE_M = 0.52, 0.40, 0.010  # size of the plate
COAT_M = 0.0010
"""Thickness of the painted squares, whose upper faces make the face of the board."""
MASS_KG = 1.3
"""An aluminium honeycomb plate of about 600 kg/m3."""

MATT_WHITE = Material(name="board-white", base_color=(0.80, 0.80, 0.80), roughness=0.95)
MATT_BLACK = Material(name="board-black", base_color=(0.03, 0.03, 0.03), roughness=0.95)
NOTES = (
    "Face at z = 0, x right, y up. Keypoints are the inner corners in OpenCV's order, rows from the top. Levels of "
    "detail are the same."
)


def build_chessboard(detail: Detail = "full") -> Target:  # noqa: ARG001 (one geometry for all levels)
    """Return the board; every level is the same."""
    light = Piece("squares_light", MATT_WHITE.name, merge(squares(dark=False)))
    return board("chessboard", "Chessboard, 11 x 8 squares of 40 mm", light, notes=NOTES)


def board(
    name: str,
    title: str,
    light: Piece,
    *,
    notes: str,
    materials: tuple[Material, ...] = (),
    pictures: tuple[TextureImage, ...] = (),
) -> Target:
    """Return a board with the given light squares; dark squares, plate, labels and mass are the same for all."""
    return assemble(
        name,
        title,
        pieces=[
            Piece("plate", "bare-aluminium", _plate(-COAT_M)),
            Piece("margin", MATT_WHITE.name, _margin()),
            Piece("squares_dark", MATT_BLACK.name, merge(squares(dark=True))),
            light,
        ],
        materials=(MATT_WHITE, MATT_BLACK, *FINISHES, *materials),
        keypoints=_corners(),
        wireframe=_wireframe(),
        occluders=[_plate(0.0)],
        lumps=[
            MassElement("plate", MASS_KG, (0.0, 0.0, -PLATE_M / 2), size_m=(PLATE_X_M, PLATE_Y_M, PLATE_M))
        ],
        frames={
            "face": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
            "handle": ((0.0, -PLATE_Y_M / 2, -PLATE_M / 2), (0.0, -1.0, 0.0)),
        },
        # a half turn swaps dark for light: the outlines agree, the pattern does not
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=notes,
        pictures=pictures,
    )


def lines_x_m() -> FloatArray:
    """Return the (12,) x coordinates of the lines between columns, from the left [m]."""
    return np.asarray((np.arange(COLUMNS + 1) - COLUMNS / 2) * SQUARE_M, float)


def lines_y_m() -> FloatArray:
    """Return the (9,) y coordinates of the lines between rows, from the top [m]."""
    return np.asarray((ROWS / 2 - np.arange(ROWS + 1)) * SQUARE_M, float)


def squares(*, dark: bool) -> list[Mesh]:
    """Return the squares of one colour as thin tiles, row by row; the one in the upper left corner is dark."""
    xs, ys = lines_x_m(), lines_y_m()
    tiles = []
    for row in range(ROWS):
        # squares of one colour meet at their corners: in every other row they are thinner, so that
        # two of them never share an upright edge and each stays a separate closed body
        low = -COAT_M * (1.0 if row % 2 else 0.9)
        tiles += [
            box((xs[column], ys[row + 1], low), (xs[column + 1], ys[row], 0.0))
            for column in range(COLUMNS)
            if ((row + column) % 2 == 0) == dark
        ]
    return tiles


def _plate(top_m: float) -> Mesh:
    return box((-PLATE_X_M / 2, -PLATE_Y_M / 2, -PLATE_M), (PLATE_X_M / 2, PLATE_Y_M / 2, top_m))


def _margin() -> Mesh:
    xs, ys = lines_x_m(), lines_y_m()
    # the margin's hole has a vertex at every line: no gap can open along the outer squares
    hole = [(x, ys[0]) for x in xs] + [(xs[-1], y) for y in ys[1:-1]]
    hole += [(x, ys[-1]) for x in xs[::-1]] + [(xs[0], y) for y in ys[-2:0:-1]]
    outline = rectangle((-PLATE_X_M / 2, -PLATE_Y_M / 2), (PLATE_X_M / 2, PLATE_Y_M / 2))
    return prism(outline, COAT_M, holes=[hole], origin_m=(0, 0, -COAT_M))


def _corners() -> dict[str, Vec3]:
    return {
        f"corner_{row}_{column}": (float(x), float(y), 0.0)
        for row, y in enumerate(lines_y_m()[1:-1])
        for column, x in enumerate(lines_x_m()[1:-1])
    }


def _wireframe() -> list[Edge]:
    """Return the plate's edges, and the lines between squares, each a step from light to dark over its whole length."""
    low, high = (-PLATE_X_M / 2, -PLATE_Y_M / 2, -PLATE_M), (PLATE_X_M / 2, PLATE_Y_M / 2, 0.0)
    xs, ys = lines_x_m(), lines_y_m()
    edges = box_edges("plate", low, high)
    for k, x in enumerate(xs[1:-1]):
        edges += face_edges(f"column_{k}", [(x, ys[0], 0.0), (x, ys[-1], 0.0)], (0, 0, 1))[:1]
    for k, y in enumerate(ys[1:-1]):
        edges += face_edges(f"row_{k}", [(xs[0], y, 0.0), (xs[-1], y, 0.0)], (0, 0, 1))[:1]
    return edges
