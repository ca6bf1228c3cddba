"""Crew Dragon's trunk: an open tube, one half solar cells, the other radiator, with four fins."""

from __future__ import annotations

import itertools

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.dragon.crew_shape import (
    FIN_AZIMUTHS_DEG,
    FIN_M,
    FIN_THICK_M,
    TRUNK,
    TRUNK_HIGH_M,
    TRUNK_INNER_M,
    TRUNK_LOW_M,
    TRUNK_RADIUS_M,
)
from tools.craft.hardware import open_tube
from tools.craft.labels import RIM_SEGMENTS
from tools.craft.level import Level
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import clipped_rectangle, prism
from tools.craft.shapes.wrapped import sector, tiled

SOLAR_DEG = (94.0, 266.0)
CELL_LOW_M, CELL_HIGH_M = -3.45, -0.18
STRIPS = 14
"""Upright columns of cells on the solar half."""


def build_trunk(level: Level) -> list[Piece]:
    """Return the tube, cells, radiators, fins."""
    n = level.segments(RIM_SEGMENTS)
    ri, ro, lo, hi = TRUNK_INNER_M, TRUNK_RADIUS_M, TRUNK_LOW_M, TRUNK_HIGH_M
    fin = fin_mesh()
    pieces = [
        Piece("trunk_tube", "white-paint", open_tube(ri + 0.002, ro, lo, hi, n)),
        Piece("trunk_liner", "grey-paint", open_tube(ri - 0.02, ri + 0.004, lo + 0.02, hi, n)),
        Piece("fins", "white-paint", merge([fin.rotated(turn_z(a)) for a in np.deg2rad(FIN_AZIMUTHS_DEG)])),
        *_solar_half(level),
    ]
    if level.fittings:
        pieces += _radiators(level)
    return pieces


def fin_mesh() -> Mesh:
    """Return a fin at azimuth zero."""
    return prism(FIN_M, FIN_THICK_M, origin_m=(0, FIN_THICK_M / 2, 0), u=(1, 0, 0), v=(0, 0, 1))


def _solar_half(level: Level) -> list[Piece]:
    a, b = np.deg2rad(SOLAR_DEG)
    columns = level.segments(48)
    base = sector(TRUNK, (a, b), [CELL_LOW_M - 0.03, CELL_HIGH_M + 0.03], 0.006, 0.02, columns)
    edges = np.linspace(a, b, STRIPS + 1)
    lift = 0.0062
    if not level.fittings:
        field = sector(TRUNK, (a + 0.01, b - 0.01), [CELL_LOW_M, CELL_HIGH_M], 0.012, 0.0, columns)
    elif not level.fine:
        field = merge(
            [
                sector(TRUNK, (p + 0.012, q - 0.012), [CELL_LOW_M, CELL_HIGH_M], 0.012, 0.0, 4)
                for p, q in itertools.pairwise(edges)
            ]
        )
    else:
        # two cells across each strip, gaps between strips
        span = edges[1] - edges[0]
        azimuths = [p + span * (0.5 + s * 0.228) for p in edges[:-1] for s in (-1, 1)]
        rows = 40
        pitch = (CELL_HIGH_M - CELL_LOW_M) / rows
        width, height = 0.45 * span * TRUNK_RADIUS_M, pitch - 0.005
        tile = prism(clipped_rectangle(width, height, 0.010, "all"), 0.006)
        heights = CELL_LOW_M + (np.arange(rows) + 0.5) * pitch
        field = tiled(TRUNK, azimuths, heights, tile, lift - 0.002)
    return [Piece("trunk_cell_base", "cell-substrate", base), Piece("trunk_cells", "solar-cell-black", field)]


def _radiators(level: Level) -> list[Piece]:
    """Return the panels of the radiator half, between the fins and the solar half's borders."""
    edges = np.deg2rad([-82.0, -48.0, -24.0, 0.0, 24.0, 48.0, 82.0])
    rows = [-3.42, -0.20]
    panels = [
        sector(TRUNK, (p + 0.012, q - 0.012), rows, 0.010, 0.01, level.segments(12))
        for p, q in itertools.pairwise(edges)
    ]
    return [Piece("radiators", "radiator", merge(panels))]
