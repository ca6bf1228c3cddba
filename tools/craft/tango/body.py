"""Tango's body: bottom plate, two white side plates, the closed core between them with its +-y covers."""

from __future__ import annotations

from tools.craft.assemble import Piece
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import box
from tools.craft.tango.dimensions import BOTTOM_PLATE_M, SIDE_PLATE_M, SPEED, TangoDimensions

SKIN_M = 0.0010
"""Painted face sheets are their own thin bodies, so that plate edges keep their bare grey."""
INSET_M = 0.0020
"""The +-y covers lie this far behind the plates' edges."""


def build_body(d: TangoDimensions = SPEED) -> list[Piece]:
    """Plates, face sheets and covers: boxes, the same at every level of detail."""
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
