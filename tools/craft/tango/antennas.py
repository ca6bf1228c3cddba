"""Tango's rod antennas (three, four in the thesis): a stub at the root, a collar, and a tapered rod to the tip."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.level_of_detail import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import merge, unit
from tools.craft.shapes.solids import lathe
from tools.craft.tango.dimensions import (
    ANTENNA_RADIUS_COLLAR_M,
    ANTENNA_RADIUS_STUB_M,
    ANTENNA_RADIUS_TIP_M,
    SPEED,
    TangoDimensions,
)


def build_antennas(detail: Detail = "full", d: TangoDimensions = SPEED) -> list[Piece]:
    """The rods, one part each, and their collars."""
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
