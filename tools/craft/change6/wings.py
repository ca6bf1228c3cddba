"""Nearly circular wings of Chang'e-6's ascent vehicle."""

from __future__ import annotations

import itertools

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.change6.dimensions import (
    CELL_M,
    CORE_INSET_M,
    WIDTH_M,
    WING_PLATE_M,
    WING_RADIUS_M,
    WING_SIDES,
    WING_Y_M,
    WING_Z_M,
    wing_outline,
)
from tools.craft.level import facets
from tools.craft.place import both_sides
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import circle, clipped_rectangle, prism, rectangle
from tools.craft.shapes.solids import box, rod


def build_wings(detail: Detail) -> list[Piece]:
    """Return two sixteen-sided plates with cells above, each on a yoke."""
    plate = prism(wing_outline(), WING_PLATE_M, origin_m=(0, 0, WING_Z_M - WING_PLATE_M))
    rim_ring = wing_outline()
    inner = circle((0.0, WING_Y_M), WING_RADIUS_M - 0.020, WING_SIDES)
    rim = prism(rim_ring, 0.004, holes=[inner], origin_m=(0, 0, WING_Z_M))
    root = WIDTH_M / 2 - CORE_INSET_M
    inside = WING_Y_M - WING_RADIUS_M * np.cos(np.pi / WING_SIDES)
    yoke = [
        rod(
            (s * 0.13, root - 0.01, WING_Z_M - 0.02),
            (s * 0.13, inside + 0.06, WING_Z_M - 0.032),
            0.016,
            facets(detail, 16),
        )
        for s in (-1, 1)
    ]
    hinge = rod(
        (-0.20, root + 0.045, WING_Z_M - 0.022),
        (0.20, root + 0.045, WING_Z_M - 0.022),
        0.024,
        facets(detail, 20),
    )
    ribs = [
        box(
            (-0.62, WING_Y_M + y - 0.008, WING_Z_M - WING_PLATE_M - 0.020),
            (0.62, WING_Y_M + y + 0.008, WING_Z_M - WING_PLATE_M + 0.001),
        )
        for y in (-0.22, 0.22)
    ]
    pieces = [
        Piece("wing_plates", "kapton-substrate", merge(both_sides(plate, 1))),
        Piece("wing_rims", "bare-aluminium", merge(both_sides(rim, 1))),
        Piece("wing_cells", "solar-cell", merge(both_sides(_wing_cells(detail), 1))),
        Piece("wing_yokes", "bare-aluminium", merge([m for r in (*yoke, hinge) for m in both_sides(r, 1)])),
    ]
    if detail != "low":
        pieces.append(Piece("wing_ribs", "carbon-fibre", merge([m for r in ribs for m in both_sides(r, 1)])))
    return pieces


def _wing_cells(detail: Detail) -> Mesh:
    """Return the rows of cells that fit within the wing's rim; one plate at low detail."""
    reach = (WING_RADIUS_M - 0.026) * np.cos(np.pi / WING_SIDES)
    if detail == "low":
        return prism(
            circle((0.0, WING_Y_M), WING_RADIUS_M - 0.03, WING_SIDES), 0.0015, origin_m=(0, 0, WING_Z_M)
        )
    pitch = CELL_M if detail == "full" else (2 * CELL_M[0], 2 * CELL_M[1])
    w, h, clip = pitch[0] - 0.0015, pitch[1] - 0.0015, 0.006
    outline = (
        clipped_rectangle(w, h, clip, "all")
        if detail == "full"
        else rectangle((-w / 2, -h / 2), (w / 2, h / 2))
    )
    tile = prism(outline, 0.0015)
    count = (int(reach / pitch[0]) + 1, int(reach / pitch[1]) + 1)
    tiles = []
    for i, j in itertools.product(range(-count[0], count[0]), range(-count[1], count[1])):
        x, y = (i + 0.5) * pitch[0], (j + 0.5) * pitch[1]
        if np.hypot(abs(x) + w / 2, abs(y) + h / 2) < reach:
            tiles.append(tile.moved((x, WING_Y_M + y, WING_Z_M)))
    return merge(tiles)
