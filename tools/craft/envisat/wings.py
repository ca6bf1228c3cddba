"""Envisat's large flat parts: the solar array on its yoke, and the ASAR antenna with its tiles."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.envisat.dimensions import (
    ARRAY_GAP_M,
    ARRAY_HALF_Y_M,
    ARRAY_PANELS,
    ARRAY_PITCH_M,
    ARRAY_PLATE_M,
    ARRAY_ROOT_X_M,
    ARRAY_U,
    ARRAY_V,
    ASAR_CENTRE,
    ASAR_GAP_M,
    ASAR_HALF_WIDTH_M,
    ASAR_HALF_Y_M,
    ASAR_PANELS,
    ASAR_PLATE_M,
    ASAR_U,
    ASAR_V,
    BUS_HALF_Z_M,
    RING_M,
)
from tools.craft.level import facets
from tools.craft.place import placed_pieces
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box, cone, rod, truss
from tools.craft.solar import CellField, panel

FIELDS: dict[Detail, CellField] = {
    "full": CellField(columns=9, rows=40, pitch_x_m=0.104, pitch_y_m=0.1225, gap_m=0.004, height_m=0.002),
    "medium": CellField(columns=3, rows=10, pitch_x_m=0.312, pitch_y_m=0.49, gap_m=0.004, height_m=0.002),
    "low": CellField(columns=1, rows=1, pitch_x_m=0.936, pitch_y_m=4.90, gap_m=0.004, height_m=0.002),
}
"""One tile stands for a group of the 2 x 4 cm cells in series."""


def build_array(detail: Detail) -> list[Piece]:
    """Return fourteen panels with hinges and stiffeners, and the arm from the drive, at the angle at which the drive
    stopped.
    """
    pieces: list[Piece] = []
    size = (ARRAY_PITCH_M - ARRAY_GAP_M, 2 * ARRAY_HALF_Y_M)
    hinges, ribs = [], []
    for k in range(ARRAY_PANELS):
        # the outer half gap at each end belongs to the panels: the wing is exactly 14 m long
        x = ARRAY_ROOT_X_M + (k + 0.5) * ARRAY_PITCH_M
        one = panel(
            "array",
            size,
            ARRAY_PLATE_M,
            FIELDS[detail],
            detail=detail,
            board="carbon-fibre",
            cell="solar-cell-silicon",
        )
        pieces += placed_pieces(one, (x, 0, 0), (1, 0, 0), (0, 1, 0))
        if detail == "low":
            continue
        for y in (-1.7, 0.0, 1.7):
            if k > 0:
                hinge_x = x - ARRAY_PITCH_M / 2
                hinges.append(
                    rod((hinge_x, y - 0.06, -0.020), (hinge_x, y + 0.06, -0.020), 0.016, facets(detail, 12))
                )
        top = -ARRAY_PLATE_M + 0.002
        ribs += [
            box((x - 0.46, y - 0.02, top - 0.037), (x + 0.46, y + 0.02, top)) for y in (-2.1, -0.8, 0.8, 2.1)
        ]
    if hinges:
        pieces += [
            Piece("array_hinges", "bare-aluminium", merge(hinges)),
            Piece("array_ribs", "grey-paint", merge(ribs)),
        ]
    return placed_pieces([*pieces, *_arm(detail)], (0, 0, 0), ARRAY_U, ARRAY_V)


def _arm(detail: Detail) -> list[Piece]:
    """Return the drive on the axis of the ring, a mast, and a yoke to the first panel's corners."""
    n = facets(detail, 32)
    z = -ARRAY_PLATE_M / 2 - 0.03
    drive = cone((0.0, 0, z), (RING_M + 0.22, 0, z), 0.22, 0.20, n)
    mast = cone((RING_M + 0.20, 0, z), (1.15, 0, z), 0.075, 0.075, n)
    nodes = np.array([(1.10, 0, z), (1.98, -1.9, z), (1.98, 1.9, z), (1.98, -0.6, z), (1.98, 0.6, z)])
    yoke = truss(nodes, [(0, 1), (0, 2), (0, 3), (0, 4), (1, 3), (3, 4), (4, 2)], 0.035, facets(detail, 16))
    feet = [
        box((1.95, y - 0.05, z - 0.03), (2.06, y + 0.05, -ARRAY_PLATE_M + 0.004))
        for y in (-1.9, -0.6, 0.6, 1.9)
    ]
    return [
        Piece("array_drive", "mli-silver", drive),
        Piece("array_mast", "carbon-fibre", merge([mast, yoke])),
        Piece("array_feet", "bare-aluminium", merge(feet)),
    ]


def build_asar(detail: Detail) -> list[Piece]:
    """Return five panels of four tiles; slotted waveguides show as stripes, the back carries frames and insulated
    boxes.
    """
    plates, tiles, stripes, frames, boxes = [], [], [], [], []
    length = 2 * ASAR_HALF_Y_M / ASAR_PANELS
    w = ASAR_HALF_WIDTH_M
    for k in range(ASAR_PANELS):
        # x here runs along the antenna; the outermost edges reach its full length
        x0 = -ASAR_HALF_Y_M + k * length + (ASAR_GAP_M / 2 if k else 0.0)
        x1 = -ASAR_HALF_Y_M + (k + 1) * length - (ASAR_GAP_M / 2 if k < ASAR_PANELS - 1 else 0.0)
        plates.append(box((x0, -w, -ASAR_PLATE_M), (x1, w, -0.012)))
        middle = (x0 + x1) / 2
        for a, b in ((x0, middle - 0.004), (middle + 0.004, x1)):
            for low, high in ((-w, -0.004), (0.004, w)):
                tiles.append(box((a, low, -0.013), (b, high, 0.0)))
                if detail == "full":
                    stripes += _stripes(a, b, low, high)
        back = -ASAR_PLATE_M
        frames += [
            box((x0 + 0.03, y - 0.025, back - 0.09), (x1 - 0.03, y + 0.025, back + 0.001))
            for y in (-0.52, 0.0, 0.52)
        ]
        frames += [
            box((x - 0.02, -0.60, back - 0.085), (x + 0.02, 0.60, back + 0.002))
            for x in (x0 + 0.05, middle, x1 - 0.05)
        ]
        for x in (x0 + 0.5 * length - 0.45, x0 + 0.5 * length + 0.42):
            boxes.append(
                box((x - 0.24, -0.42, -ASAR_PLATE_M - 0.14), (x + 0.24, -0.10, -ASAR_PLATE_M + 0.0015), 0.01)
            )
            boxes.append(
                box((x - 0.24, 0.10, -ASAR_PLATE_M - 0.14), (x + 0.24, 0.42, -ASAR_PLATE_M + 0.0015), 0.01)
            )
    pieces = [
        Piece("asar_panels", "carbon-fibre", merge(plates)),
        Piece("asar_tiles", "asar-tile", merge(tiles)),
        Piece("asar_frames", "carbon-fibre", merge(frames)),
    ]
    if stripes:
        pieces.append(Piece("asar_waveguides", "bare-aluminium", merge(stripes)))
    if detail != "low":
        pieces.append(Piece("asar_boxes", "mli-silver", merge(boxes)))
    return [*placed_pieces(pieces, ASAR_CENTRE, ASAR_U, ASAR_V), *_asar_mount(detail)]


def _stripes(a: float, b: float, low: float, high: float) -> list[Mesh]:
    """Return the sixteen waveguides of a tile, a millimetre proud."""
    ys = np.linspace(low, high, 17)
    return [box((a + 0.03, y - 0.004, -0.001), (b - 0.03, y + 0.004, 0.001)) for y in (ys[:-1] + ys[1:]) / 2]


def _asar_mount(detail: Detail) -> list[Piece]:
    """Return the struts from the bus to the middle panel."""
    x, _, z = ASAR_CENTRE
    foot = BUS_HALF_Z_M - 0.03
    top = z - 0.22
    nodes = np.array(
        [
            (x - 0.55, -0.85, foot), (x - 0.55, 0.85, foot), (x + 0.55, -0.85, foot), (x + 0.55, 0.85, foot),
            (x - 0.45, -0.80, top + 0.17), (x - 0.45, 0.80, top + 0.17),
            (x + 0.45, -0.80, top - 0.13), (x + 0.45, 0.80, top - 0.13),
        ]
    )  # fmt: skip
    members = [(0, 4), (1, 5), (2, 6), (3, 7), (0, 6), (1, 7), (0, 5), (2, 7)]
    return [Piece("asar_mount", "carbon-fibre", truss(nodes, members, 0.03, facets(detail, 16)))]
