"""Tango's fittings: connector block on the panel's edge, side box, rod with clips, +y plates."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import circle, prism, rectangle
from tools.craft.shapes.solids import box, dome, rod
from tools.craft.tango.dimensions import (
    BODY_X_M,
    BODY_Y_HIGH_M,
    CONNECTOR_BOTTOM_M,
    CONNECTOR_OUTLINE_M,
    CONNECTOR_TOP_M,
    ROD_BOTTOM_M,
    ROD_RADIUS_M,
    ROD_TOP_M,
    ROD_X_M,
    ROD_Y_M,
    SIDE_BOX_HIGH_M,
    SIDE_BOX_LOW_M,
    WHITE_PLATE_HIGH_M,
    WHITE_PLATE_LOW_M,
)

WINDOWS_X_M = (-0.0268, 0.0173, 0.0456)
WINDOW_Y_M = 0.413
CLIPS_Z_M = (0.1725, 0.0425)
CLIP_SADDLE_M = 0.0150
"""The rod's clips: a saddle from the -x face to the rod ..."""
CLIP_STRAP_M = 0.0088
"""... and a strap that stands so far over it."""


def build_fittings(detail: Detail = "full") -> list[Piece]:
    """Return everything bolted on that is neither bracket nor instrument."""
    return [*_connector(detail), *_side_box(), *_rod(detail), *_plates_high_y(detail)]


def _connector(detail: Detail) -> list[Piece]:
    """Return an L-shaped white block with three square windows, on a flange, with a second block under the panel."""
    z0, z1 = CONNECTOR_BOTTOM_M, CONNECTOR_TOP_M
    white = [
        prism(CONNECTOR_OUTLINE_M, z1 - z0, origin_m=(0, 0, z0)),
        box((-0.0604, 0.3850, 0.3030), (0.0813, 0.3930, 0.3180)),
        box((0.0020, 0.3850, 0.2775), (0.0830, 0.3990, 0.2970), 0.001),
        box((0.0300, 0.3860, 0.2960), (0.0600, 0.3930, 0.3040)),
    ]
    glass = []
    for x in WINDOWS_X_M:
        frame = rectangle((x - 0.0125, WINDOW_Y_M - 0.0135), (x + 0.0125, WINDOW_Y_M + 0.0135))
        opening = rectangle((x - 0.0095, WINDOW_Y_M - 0.0105), (x + 0.0095, WINDOW_Y_M + 0.0105))
        white.append(prism(frame, 0.0030, holes=[opening], origin_m=(0, 0, z1 - 0.0002)))
        white.append(dome((x, WINDOW_Y_M, z1 - 0.0002), (0, 0, 1), 0.0068, 0.0055, facets(detail, 16), 4))
        floor = rectangle((x - 0.0093, WINDOW_Y_M - 0.0103), (x + 0.0093, WINDOW_Y_M + 0.0103))
        glass.append(prism(floor, 0.0010, origin_m=(0, 0, z1 - 0.0003)))
    dark = [
        rod((0.0260, 0.3985, 0.2872), (0.0260, 0.4000, 0.2872), 0.0060, facets(detail, 16)),
        box((0.0210, 0.3845, 0.2830), (0.0350, 0.3852, 0.2915)),
        box((0.0600, 0.3845, 0.2820), (0.0780, 0.3852, 0.2925)),
    ]
    return [
        Piece("connector_block", "white-paint", merge(white)),
        Piece("connector_windows", "plate-edge", merge(glass)),
        Piece("connector_sockets", "instrument-black", merge(dark)),
    ]


def _side_box() -> list[Piece]:
    """Return the small white box on the +x face, and the grey cover next to it."""
    (_, y0, z0), (x1, y1, z1) = SIDE_BOX_LOW_M, SIDE_BOX_HIGH_M
    shell = box(SIDE_BOX_LOW_M, SIDE_BOX_HIGH_M)
    below = [(y0 - 0.003, z0), (y1 + 0.003, z0), (y1 - 0.004, z0 - 0.012), (y0 + 0.004, z0 - 0.012)]
    foot = prism(below, 0.014, origin_m=(BODY_X_M, 0, 0), u=(0, 1, 0), v=(0, 0, 1))
    windows = [
        box((x1 - 0.0002, y, z1 - 0.016), (x1 + 0.0008, y + 0.010, z1 - 0.006))
        for y in (y0 + 0.006, y1 - 0.016)
    ]
    cover = box((BODY_X_M, 0.1820, 0.2630), (BODY_X_M + 0.004, 0.2190, 0.2780))
    return [
        Piece("side_box", "white-paint", merge([shell, foot])),
        Piece("side_box_windows", "body-dark", merge(windows)),
        Piece("side_cover", "plate-edge", cover),
    ]


def _rod(detail: Detail) -> list[Piece]:
    """Return the rod along z off the -x face, its two clips, and the small marks next to it."""
    face = -BODY_X_M
    bar = rod(
        (ROD_X_M, ROD_Y_M, ROD_BOTTOM_M), (ROD_X_M, ROD_Y_M, ROD_TOP_M), ROD_RADIUS_M, facets(detail, 24)
    )
    saddle, strap = face - CLIP_SADDLE_M, ROD_X_M - ROD_RADIUS_M - CLIP_STRAP_M
    clips, bolts = [], []
    for z in CLIPS_Z_M:
        clips.append(box((saddle, ROD_Y_M - 0.0295, z - 0.0085), (face, ROD_Y_M + 0.0295, z + 0.0085)))
        clips.append(
            box((strap, ROD_Y_M - 0.0135, z - 0.0070), (saddle + 0.001, ROD_Y_M + 0.0135, z + 0.0070), 0.003)
        )
        bolts += [
            rod(
                (saddle + 0.001, ROD_Y_M + s * 0.0215, z),
                (saddle - 0.0028, ROD_Y_M + s * 0.0215, z),
                0.0028,
                facets(detail, 8),
            )
            for s in (-1, 1)
        ]
    disc = [circle((y, z), 0.0058, facets(detail, 16)) for y, z in ((0.2105, 0.2110), (0.2105, 0.0815))]
    # on the -x face the plane's axes are z, y: z x y = -x
    marks = [prism(d[:, ::-1], 0.0010, origin_m=(face, 0, 0), u=(0, 0, 1), v=(0, 1, 0)) for d in disc]
    marks.append(box((face - 0.0012, 0.2400, 0.1895), (face, 0.2690, 0.2075)))
    marks.append(
        rod((face - 0.0020, 0.2495, 0.2560), (face - 0.0020, 0.2495, 0.2895), 0.0016, facets(detail, 8))
    )
    return [
        Piece("rod", "antenna-grey", bar),
        Piece("rod_clips", "aluminium", merge(clips)),
        Piece("rod_bolts", "interconnect", merge(bolts)),
        Piece("side_marks", "body-dark", merge(marks)),
    ]


def _plates_high_y(detail: Detail) -> list[Piece]:
    """Return the white plate on standoffs and the grey plate with its pins on the +y face."""
    (x0, y0, z0), (x1, y1, z1) = WHITE_PLATE_LOW_M, WHITE_PLATE_HIGH_M
    plate = box(WHITE_PLATE_LOW_M, WHITE_PLATE_HIGH_M)
    standoffs = [
        box((x - 0.006, BODY_Y_HIGH_M - 0.004, z - 0.006), (x + 0.006, y0 + 0.001, z + 0.006))
        for x in (x0 + 0.02, (x0 + x1) / 2, x1 - 0.02)
        for z in (z0 + 0.012, z1 - 0.012)
    ]
    rim = [(x, z) for x in np.linspace(x0 + 0.006, x1 - 0.006, 5) for z in (z0 + 0.006, z1 - 0.006)]
    rim += [(x, (z0 + z1) / 2) for x in (x0 + 0.006, x1 - 0.006)]
    bolts = [rod((x, y1 - 0.0005, z), (x, y1 + 0.0025, z), 0.0025, facets(detail, 8)) for x, z in rim]
    grey = box((-0.1600, BODY_Y_HIGH_M - 0.0030, 0.0205), (-0.0805, BODY_Y_HIGH_M + 0.0030, 0.1280))
    pins = [
        rod((x, BODY_Y_HIGH_M + 0.002, z), (x, BODY_Y_HIGH_M + 0.013, z), 0.0022, facets(detail, 8))
        for x in (-0.1340, -0.1205, -0.1070)
        for z in (0.048, 0.063, 0.078, 0.093, 0.108)
    ]
    return [
        Piece("plate_white", "white-paint", plate),
        Piece("plate_standoffs", "body-dark", merge(standoffs)),
        Piece("plate_bolts", "plate-edge", merge(bolts)),
        Piece("plate_grey", "plate-edge", grey),
        Piece("plate_pins", "white-paint", merge(pins)),
    ]
