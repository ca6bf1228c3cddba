"""Tango's panel, body and antennas, for any set of its dimensions."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import merge, unit
from tools.craft.shapes.prism import cell_grid, clipped_rectangle, prism, rectangle
from tools.craft.shapes.solids import box, lathe
from tools.craft.tango.dimensions import (
    ANTENNA_RADIUS_COLLAR_M,
    ANTENNA_RADIUS_STUB_M,
    ANTENNA_RADIUS_TIP_M,
    BOTTOM_PLATE_M,
    FRAME_X_M,
    FRAME_Y_M,
    SIDE_PLATE_M,
    SPEED,
    STRIP_M,
    TangoDimensions,
)

BACK_SHEET_M = 0.0020
GAP_M = 0.0014
CLIP_M = 0.0105
SUBSTRATE_M = 0.0020
"""The substrate lies this far below the frame's face."""
CELL_M = 0.0004
"""Cells stand this far proud of the substrate: 0.15 mm of wafer, 0.15 of cover glass, the rest adhesive."""
TAB_M = 0.0002
TAB_INSET_M = 0.0006
"""Free space between an interconnect and the cells next to it."""


def build_panel(detail: Detail = "full", d: TangoDimensions = SPEED) -> list[Piece]:
    """Return the frame, back sheet, substrate, cells and the interconnect tabs in the gaps of the clipped corners.

    Cells lose their clipped corners at medium detail, and become one sheet per field at low.
    """
    panel_x, panel_y, columns, rows = d.panel_x_m, d.panel_y_m, d.columns, d.rows
    top = d.panel_top_m - SUBSTRATE_M
    inner_x, inner_y = panel_x - FRAME_X_M, panel_y - FRAME_Y_M
    windows = [
        rectangle((-inner_x, -inner_y), (-STRIP_M / 2, inner_y)),
        rectangle((STRIP_M / 2, -inner_y), (inner_x, inner_y)),
    ]
    outline = rectangle((-panel_x, -panel_y), (panel_x, panel_y))
    back = d.panel_bottom_m + BACK_SHEET_M
    frame = prism(outline, d.panel_top_m - back, holes=windows, origin_m=(0, 0, back))
    sheet = box((-panel_x, -panel_y, d.panel_bottom_m), (panel_x, panel_y, back))
    margin = 0.004
    substrate = box(
        (-inner_x - margin, -inner_y - margin, back - 0.001), (inner_x + margin, inner_y + margin, top)
    )
    if detail == "low":
        y_half = rows * d.cell_pitch_y_m / 2 - GAP_M / 2
        x0, x1 = STRIP_M / 2 + GAP_M / 2, STRIP_M / 2 + columns * d.cell_pitch_x_m - GAP_M / 2
        sheet_of_cells = box((x0, -y_half, top), (x1, y_half, top + CELL_M))
        return [
            Piece("panel_frame", "panel-frame", frame),
            Piece("panel_back", "panel-frame", sheet),
            Piece("panel_substrate", "panel-substrate", substrate),
            Piece("panel_cells", "solar-cell", merge([sheet_of_cells, sheet_of_cells.mirrored(0)])),
        ]
    y = (np.arange(rows) - (rows - 1) / 2) * d.cell_pitch_y_m
    centres = (np.arange(columns) + 0.5) * d.cell_pitch_x_m
    joints = np.arange(columns + 1) * d.cell_pitch_x_m
    width, height = d.cell_pitch_x_m - GAP_M, d.cell_pitch_y_m - GAP_M
    fields, tabs = [], []
    # wafers cut in half: one field shows the upper halves, the other the lower ones
    for side, clipped, up in ((-1.0, "top", 1.0), (1.0, "bottom", -1.0)):
        tile = clipped_rectangle(width, height, CLIP_M, clipped)
        if detail == "medium":
            tile = rectangle((-width / 2, -height / 2), (width / 2, height / 2))
        fields.append(cell_grid(side * (STRIP_M / 2 + centres), y, tile, top, CELL_M))
        base = up * height / 2
        reach = GAP_M / 2 + CLIP_M - 2 * TAB_INSET_M
        tab = np.array([(-reach, base), (0, base - up * reach), (reach, base)])
        tabs.append(cell_grid(side * (STRIP_M / 2 + joints), y, tab, top, TAB_M))
    pieces = [
        Piece("panel_frame", "panel-frame", frame),
        Piece("panel_back", "panel-frame", sheet),
        Piece("panel_substrate", "panel-substrate", substrate),
        Piece("panel_cells", "solar-cell", merge(fields)),
    ]
    if detail == "full":
        # the tabs are in the gaps left by clipped corners
        pieces.append(Piece("panel_interconnects", "interconnect", merge(tabs)))
    return pieces


SKIN_M = 0.0010
"""Painted face sheets are their own thin bodies, so that plate edges keep their bare grey."""
INSET_M = 0.0020
"""The +-y covers lie this far behind the plates' edges."""


def build_body(d: TangoDimensions = SPEED) -> list[Piece]:
    """Return the plates, face sheets and covers: boxes, the same at every level of detail."""
    x, y0, y1 = d.body_x_m, d.body_y_low_m, d.body_y_high_m
    top, core_top = d.body_top_m, d.core_top_m
    inner = x - SIDE_PLATE_M
    bottom = box((-x, y0, SKIN_M), (x, y1, BOTTOM_PLATE_M))
    bottom_sheet = box((-x, y0, 0.0), (x, y1, SKIN_M))
    side = box((inner, y0, BOTTOM_PLATE_M), (x - SKIN_M, y1, top))
    side_sheet = box((x - SKIN_M, y0, BOTTOM_PLATE_M), (x, y1, top))
    cover = 0.004
    core = box((-inner, y0 + cover, BOTTOM_PLATE_M), (inner, y1 - cover, core_top))
    cover_low = box((-inner, y0 + INSET_M, BOTTOM_PLATE_M), (inner, y0 + cover, core_top))
    cover_high = box((-inner, y1 - cover, BOTTOM_PLATE_M), (inner, y1 - INSET_M, core_top))
    return [
        Piece("body_core", "body-dark", core),
        Piece("body_bottom_plate", "plate-edge", bottom),
        Piece("body_bottom_sheet", "white-paint", bottom_sheet),
        Piece("body_side_plates", "plate-edge", merge([side.mirrored(0), side])),
        Piece("body_side_sheet_nx", "white-paint", side_sheet.mirrored(0)),
        Piece("body_side_sheet_px", "white-paint", side_sheet),
        Piece("body_cover_ny", "body-grey", cover_low),
        Piece("body_cover_py", "body-dark", cover_high),
    ]


def build_antennas(detail: Detail = "full", d: TangoDimensions = SPEED) -> list[Piece]:
    """Return the rods, one part each, and their collars."""
    pieces, collars = [], []
    for k, (root, tip) in enumerate(zip(d.antenna_roots, d.antenna_tips, strict=True)):
        axis = np.subtract(tip, root)
        length = float(np.linalg.norm(axis))
        s, c = ANTENNA_RADIUS_STUB_M, d.antenna_collar_m
        profile = [
            (0, 0),
            (0.7 * s, 0),
            (s, 0.010),
            (s, c),
            (ANTENNA_RADIUS_COLLAR_M, c),
            (ANTENNA_RADIUS_TIP_M, length),
            (0, length),
        ]
        pieces.append(
            Piece(f"antenna_{k + 1}", "antenna-grey", lathe(profile, root, axis, facets(detail, 40)))
        )
        r = ANTENNA_RADIUS_COLLAR_M
        ring = [(r - 0.002, 0), (r + 0.0025, 0), (r + 0.0025, 0.006), (r - 0.002, 0.006), (r - 0.002, 0)]
        collars.append(lathe(ring, np.asarray(root) + unit(axis) * (c + 0.001), axis, facets(detail, 40)))
    pieces.append(Piece("antenna_collars", "aluminium", merge(collars)))
    return pieces
