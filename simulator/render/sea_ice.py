"""The sea's ice through the year: a climatology, because the maps show open water in every month.

Edges of the ice at its largest and smallest, drawn by hand in steps of 15 degrees so that the area within them comes to
the month's extent; between them by that extent. The extents are those of 1981-2010 as commonly quoted from NSIDC's Sea
Ice Index (Fetterer et al. 2017), rounded, not read from its files. What the sea is like on a given day nobody can know
from the date.
"""

from __future__ import annotations

from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import ByteArray, FloatArray

WIDTH, HEIGHT = 360, 180
EDGE_DEG = 4.0  # from the edge, where there is none, to where floes leave a tenth open
_PACK = 0.92  # share of ice inside
_YEAR = 365.25
_LONGITUDES = np.arange(-180.0, 180.0, 15.0)
# latitude of the edge [deg] every 15 degrees from the date line eastward; 90: none
# fmt: off
_NORTH = {
    "largest": (60, 59, 58, 66, 60, 58, 51, 51, 51, 57, 65, 69, 75, 77, 76, 73, 70, 65, 60, 56, 53, 52, 53, 59),
    "smallest": (74, 73, 73, 72, 71, 70, 70, 72, 74, 76, 72, 76, 81, 82, 82, 82, 81, 80, 79, 77, 76, 74, 74, 74),
}
_SOUTH = {
    "largest": (63, 63, 63, 64, 64, 65, 65, 64, 61, 58, 56, 55, 55, 56, 57, 58, 59, 60, 61, 62, 62, 62, 62, 62),
    "smallest": (74, 73, 71, 71, 72, 72, 71, 69, 66, 68, 71, 71, 70, 69, 68, 67, 66, 66, 66, 66, 66, 66, 68, 71),
}
# million square kilometres, January to December
EXTENT_NORTH = (14.4, 15.3, 15.4, 14.7, 13.4, 11.8, 9.7, 7.2, 6.4, 8.9, 10.7, 12.8)
EXTENT_SOUTH = (5.0, 3.1, 4.0, 7.0, 10.4, 13.6, 16.2, 17.8, 18.5, 18.1, 16.0, 10.6)
# fmt: on


def sea_ice(epoch_utc: str) -> ByteArray:
    """(180, 360) share of the sea under ice, 255 for all, row 0 in the north, column 0 at -180 degrees."""
    moment = datetime.fromisoformat(epoch_utc)
    return _of_day(moment.timetuple().tm_yday)


@lru_cache(maxsize=4)
def _of_day(day: int) -> ByteArray:
    latitude = 90 - (np.arange(HEIGHT) + 0.5) * 180 / HEIGHT
    longitude = (np.arange(WIDTH) + 0.5) * 360 / WIDTH - 180
    share = np.zeros((HEIGHT, WIDTH))
    for edges, extents, sign in ((_NORTH, EXTENT_NORTH, 1.0), (_SOUTH, EXTENT_SOUTH, -1.0)):
        middles = (np.arange(12) + 0.5) / 12 * _YEAR
        extent = np.interp(day, middles, extents, period=_YEAR)
        grown = (extent - min(extents)) / (max(extents) - min(extents))
        edge = grown * np.array(edges["largest"], float) + (1 - grown) * np.array(edges["smallest"], float)
        within = sign * latitude[:, None] - np.interp(longitude, _LONGITUDES, edge, period=360.0)[None]
        share = np.maximum(share, _PACK * np.clip(within / EDGE_DEG + 0.15, 0, 1))
    return np.round(share * 255).astype(np.uint8)


def extent_m2(share: FloatArray, sea: FloatArray) -> tuple[float, float]:
    """Area of the sea that is under at least 15 % of ice, as extents are counted, north and south [m2].

    Parameters
    ----------
    share : (180, 360) 0..1. sea : (180, 360) share of each cell that is sea, not land.
    """
    rows = np.radians(90 - np.arange(HEIGHT + 1) * 180 / HEIGHT)
    area = 6_371_008.8**2 * np.abs(np.diff(np.sin(rows))) * 2 * np.pi / WIDTH
    covered = (share >= 0.15) * sea * area[:, None]
    return float(covered[: HEIGHT // 2].sum()), float(covered[HEIGHT // 2 :].sum())
