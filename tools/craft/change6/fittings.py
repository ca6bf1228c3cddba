"""Fittings on the deck and the sides of Chang'e-6's ascent vehicle."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.change6.dimensions import (
    BODY_TOP_M,
    CORE_INSET_M,
    GRIP_RADIUS_M,
    GRIP_TOP_M,
    PORT_RADIUS_M,
    PORT_TOP_M,
    WIDTH_M,
)
from tools.craft.hardware import cup, star_tracker, tube
from tools.craft.level import facets
from tools.craft.place import both_sides, turn_z
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import box, cone, lathe, rod, truss


def build_deck(detail: Detail) -> list[Piece]:
    """Return the sample port, three grips for the orbiter's claws, a cross target, reflectors, antennas, star
    trackers.
    """
    z = BODY_TOP_M
    port = cup((0, 0, z), (0, 0, 1), PORT_RADIUS_M, PORT_RADIUS_M - 0.025, PORT_TOP_M - z, 0.075, 64, detail)
    flange = tube(
        (0, 0, z + 0.004), (0, 0, 1), PORT_RADIUS_M + 0.045, PORT_RADIUS_M - 0.002, 0.018, 64, detail
    )
    hatch = cone((0, 0, z + 0.074), (0, 0, z + 0.086), 0.185, 0.175, facets(detail, 48))
    grips, feet = [], []
    n = facets(detail, 16)
    for k in range(3):
        R = turn_z(np.pi / 2 + k * 2 * np.pi / 3)
        r = GRIP_RADIUS_M
        nodes = [(r, -0.085, z), (r, -0.085, GRIP_TOP_M), (r, 0.085, GRIP_TOP_M), (r, 0.085, z)]
        grips.append(truss(np.array(nodes) @ R.T, [(0, 1), (1, 2), (2, 3)], 0.014, n))
        brace = [
            (r - 0.09, -0.085, z),
            (r, -0.085, GRIP_TOP_M - 0.02),
            (r - 0.09, 0.085, z),
            (r, 0.085, GRIP_TOP_M - 0.02),
        ]
        grips.append(truss(np.array(brace) @ R.T, [(0, 1), (2, 3)], 0.009, n))
        feet.append(box((r - 0.12, -0.115, z + 0.002), (r + 0.035, 0.115, z + 0.014)).rotated(R))
    target = [cone((-0.50, 0.0, z), (-0.50, 0.0, z + 0.020), 0.075, 0.075, facets(detail, 48))]
    cross = [
        box((-0.56, -0.006, z + 0.019), (-0.44, 0.006, z + 0.0225)),
        box((-0.506, -0.06, z + 0.019), (-0.494, 0.06, z + 0.0220)),
        rod((-0.50, 0, z + 0.02), (-0.50, 0, z + 0.075), 0.005, n),
    ]
    reflectors = [
        lathe(
            [(0, 0), (0.028, 0), (0.028, 0.03), (0.020, 0.036), (0, 0.036)],
            (x, y, z),
            (0, 0, 1),
            facets(detail, 24),
        )
        for x, y in ((0.56, 0.22), (0.56, -0.22), (-0.56, 0.24), (-0.56, -0.24), (0.30, 0.56), (0.30, -0.56))
    ]
    horn = cup((0.50, 0.0, z), (0, 0, 1), 0.060, 0.050, 0.13, 0.02, 32, detail)
    helix = cone((-0.30, 0.56, z), (-0.30, 0.56, z + 0.22), 0.030, 0.018, facets(detail, 24))
    pieces = [
        Piece("sample_port", "bare-aluminium", merge([port, flange])),
        Piece("sample_hatch", "white-paint", hatch),
        Piece("docking_grips", "titanium", merge(grips)),
        Piece("grip_feet", "bare-aluminium", merge(feet)),
        Piece("target_disc", "black-paint", merge(target)),
        Piece("target_cross", "white-paint", merge(cross)),
        Piece("reflectors", "radiator-mirror", merge(reflectors)),
        Piece("antennas", "white-paint", merge([horn, helix])),
    ]
    for k, (x, y, out) in enumerate(((-0.34, -0.58, (-0.35, -0.6, 0.72)), (-0.10, -0.60, (0.3, -0.65, 0.7)))):
        pieces += star_tracker(f"star_tracker_{k + 1}", (x, y, z), out, 0.065, 0.22, detail)
    return pieces


def build_sides(detail: Detail) -> list[Piece]:
    """Return the radiators on +-x, electronics and a landing camera on +x, wing roots on +-y."""
    face = WIDTH_M / 2 - CORE_INSET_M
    radiator = box((face - 0.002, -0.32, 0.16), (face + 0.012, 0.32, 0.78))
    pieces = [Piece("radiators", "radiator-mirror", merge(both_sides(radiator, 0)))]
    if detail == "full":
        tiles = [
            box((face + 0.0115, y - 0.0015, 0.17), (face + 0.0135, y + 0.0015, 0.77))
            for y in np.linspace(-0.28, 0.28, 15)
        ]
        tiles += [
            box((face + 0.0115, -0.31, z - 0.0015), (face + 0.0131, 0.31, z + 0.0015))
            for z in np.linspace(0.2, 0.74, 14)
        ]
        pieces.append(
            Piece("radiator_joints", "grey-paint", merge([m for t in tiles for m in both_sides(t, 0)]))
        )
    boxes = [
        box((face, -0.30, 0.81), (face + 0.09, -0.10, 0.94), 0.004),
        box((face, 0.12, 0.82), (face + 0.07, 0.32, 0.93), 0.004),
    ]
    camera = cup((face + 0.085, -0.20, 0.875), (1, 0, 0), 0.040, 0.034, 0.07, 0.01, 32, detail)
    # a lamp-like antenna on the other side, after the omnidirectional ones in the pictures
    dish = cup((-face, 0.0, 0.875), (-1, 0, 0), 0.075, 0.067, 0.05, 0.01, 48, detail)
    mast = rod((-face - 0.005, 0.0, 0.875), (-face - 0.10, 0.0, 0.875), 0.006, facets(detail, 12))
    return [
        *pieces,
        Piece("electronics", "mli-silver", merge(boxes)),
        Piece("camera", "black-paint", camera),
        Piece("side_antenna", "white-paint", merge([dish, mast])),
    ]
