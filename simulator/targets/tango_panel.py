"""Tango's solar panel: frame with a centre strip, substrate, two fields of 4 x 17 half-wafer cells."""

from __future__ import annotations

import numpy as np

from simulator.targets.assembly import Piece
from simulator.targets.builders.cells import cell_grid, clipped_rectangle
from simulator.targets.builders.mesh import merge
from simulator.targets.builders.prism import prism, rectangle
from simulator.targets.builders.solids import box
from simulator.targets.tango_dimensions import (
    CELL_PITCH_X_M,
    CELL_PITCH_Y_M,
    FRAME_X_M,
    FRAME_Y_M,
    PANEL_BOTTOM_M,
    PANEL_TOP_M,
    PANEL_X_M,
    PANEL_Y_M,
    STRIP_M,
)

COLUMNS, ROWS = 4, 17
BACK_SHEET_M = 0.0020
GAP_M = 0.0014
CLIP_M = 0.0105
SUBSTRATE_TOP_M = PANEL_TOP_M - 0.0020
CELL_M = 0.0010
"""Cells stand this far proud of the substrate and 1 mm below the frame."""
TAB_M = 0.0006
TAB_INSET_M = 0.0006
"""Free space between an interconnect and the cells beside it."""


def build_panel() -> list[Piece]:
    """Frame, back sheet, substrate, cells and the interconnect tabs in the gaps of the clipped corners."""
    inner_x, inner_y = PANEL_X_M - FRAME_X_M, PANEL_Y_M - FRAME_Y_M
    windows = [
        rectangle((-inner_x, -inner_y), (-STRIP_M / 2, inner_y)),
        rectangle((STRIP_M / 2, -inner_y), (inner_x, inner_y)),
    ]
    outline = rectangle((-PANEL_X_M, -PANEL_Y_M), (PANEL_X_M, PANEL_Y_M))
    back = PANEL_BOTTOM_M + BACK_SHEET_M
    frame = prism(outline, PANEL_TOP_M - back, holes=windows, origin_m=(0, 0, back))
    sheet = box((-PANEL_X_M, -PANEL_Y_M, PANEL_BOTTOM_M), (PANEL_X_M, PANEL_Y_M, back))
    margin = 0.004
    substrate = box(
        (-inner_x - margin, -inner_y - margin, back - 0.001),
        (inner_x + margin, inner_y + margin, SUBSTRATE_TOP_M),
    )
    y = (np.arange(ROWS) - (ROWS - 1) / 2) * CELL_PITCH_Y_M
    columns = (np.arange(COLUMNS) + 0.5) * CELL_PITCH_X_M
    joints = np.arange(COLUMNS + 1) * CELL_PITCH_X_M
    width, height = CELL_PITCH_X_M - GAP_M, CELL_PITCH_Y_M - GAP_M
    fields, tabs = [], []
    # wafers cut in half: one field shows the upper halves, the other the lower ones
    for side, clipped, up in ((-1.0, "top", 1.0), (1.0, "bottom", -1.0)):
        tile = clipped_rectangle(width, height, CLIP_M, clipped)
        fields.append(cell_grid(side * (STRIP_M / 2 + columns), y, tile, SUBSTRATE_TOP_M, CELL_M))
        base = up * height / 2
        reach = GAP_M / 2 + CLIP_M - 2 * TAB_INSET_M
        tab = np.array([(-reach, base), (0, base - up * reach), (reach, base)])
        tabs.append(cell_grid(side * (STRIP_M / 2 + joints), y, tab, SUBSTRATE_TOP_M, TAB_M))
    return [
        Piece("panel_frame", "panel-frame", frame),
        Piece("panel_back", "panel-frame", sheet),
        Piece("panel_substrate", "panel-substrate", substrate),
        Piece("panel_cells", "solar-cell", merge(fields)),
        Piece("panel_interconnects", "interconnect", merge(tabs)),
    ]
