"""Make ``assets/earth/coast_sdf_8640x4320.png`` from two shapefiles of Natural Earth 1:10m.

    python -m tools.cook.coast ne_10m_land.shp ne_10m_lakes.shp -o assets/earth/coast_sdf_8640x4320.png

Both are in the public domain: https://www.naturalearthdata.com/downloads/10m-physical-vectors/. A lake that is dry in
the day map counts as land.
"""

from __future__ import annotations

import argparse
import struct
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import day_map

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray

    Points = NDArray[np.float64]

WIDTH, HEIGHT = 8640, 4320  # size of the map [texels]
SUBPIXELS = 4
"""Rows and columns of the filled grid per pixel of the map."""
COUNTS_PER_PIXEL = 16  # eight per forty-eighth of a degree
_REACH_PX = 9  # distance from the coast beyond which the map is saturated
_BAND_ROWS = 120  # rows of the map processed at once
_SHORE_PX = 2.0  # pixels of the day map: a lake's pixels nearer to its shore are mixed with land
_FLAT_RED, _FLAT_RED_TO_GREEN = 100, 1.1  # of 255 counts, a dry salt lake; muddy lakes are darker or greener
_POLYGON = 5  # shape type (ESRI Shapefile Technical Description, 1998)


def polygons(shapefile: bytes) -> Iterator[list[Points]]:
    """Yield the rings of each polygon, (N, 2) longitude, latitude [deg]: outer ones clockwise, holes counter-clockwise.

    Raises
    ------
    ValueError
        If a record is not a polygon.
    """
    offset = 100
    while offset < len(shapefile):
        length = struct.unpack_from(">i", shapefile, offset + 4)[0]
        kind = struct.unpack_from("<i", shapefile, offset + 8)[0]
        if kind != _POLYGON:
            raise ValueError(f"the record at byte {offset} has shape type {kind}, not {_POLYGON} (polygon)")
        parts, points = struct.unpack_from("<2i", shapefile, offset + 44)
        first = np.frombuffer(shapefile, "<i4", parts, offset + 52)
        corners = np.frombuffer(shapefile, "<f8", 2 * points, offset + 52 + 4 * parts).reshape(-1, 2)
        yield np.split(corners, first[1:])
        offset += 8 + 2 * length


@dataclass(frozen=True)
class Outlines:
    """Crossings of outlines with the centres of rows, sorted by row.

    Parameters
    ----------
    row : (N,) array
        Row of the crossing.
    column : (N,) array
        First column whose centre lies east of the crossing.
    turn : (N,) array
        Change of the winding number: 1 where a clockwise ring begins, -1 where it ends.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    turn: NDArray[np.int8]

    def filled(self, rows: range, width: int) -> NDArray[np.bool_]:
        """Return (R, width), True inside: where the winding number is not zero, because polygons may overlap."""
        own = slice(*np.searchsorted(self.row, (rows.start, rows.stop)))
        turns = np.zeros((len(rows), width + 1), np.int8)
        np.add.at(turns, (self.row[own] - rows.start, self.column[own]), self.turn[own])
        return np.asarray(np.cumsum(turns, axis=1, dtype=np.int8)[:, :width] != 0)


def outlines(rings: Iterable[Points], width: int, height: int) -> Outlines:
    """Intersect rings with the centres of the rows of a grid over the whole globe."""
    edges = [np.empty((0, 4)), *(np.hstack([ring[:-1], ring[1:]]) for ring in rings)]
    x0, y0, x1, y1 = np.concatenate(edges).T
    x0, x1 = ((x + 180.0) * (width / 360.0) for x in (x0, x1))
    y0, y1 = ((90.0 - y) * (height / 180.0) for y in (y0, y1))
    top, bottom = (
        np.clip(np.ceil(pick(y0, y1) - 0.5), 0, height).astype(int) for pick in (np.minimum, np.maximum)
    )
    edge = np.repeat(np.arange(len(x0)), bottom - top)
    row = np.arange(len(edge)) + np.repeat(top - np.cumsum(bottom - top) + (bottom - top), bottom - top)
    slope = (x1 - x0)[edge] / (y1 - y0)[edge]
    column = np.ceil(x0[edge] + (row + 0.5 - y0[edge]) * slope - 0.5).clip(0, width).astype(int)
    order = np.argsort(row, kind="stable")
    turn = np.where(y1 < y0, 1, -1).astype(np.int8)[edge]  # clockwise: northwards on the western side
    return Outlines(row[order], column[order], turn[order])


def signed_distance(land: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Compute the distance to the coast, positive on land [pixels]."""
    within, without = (
        cv2.distanceTransform(side.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for side in (land, ~land)
    )
    # the coast is half a pixel closer than the nearest centre of the other side
    return np.asarray(np.where(land, within - 0.5, 0.5 - without), np.float32)


def is_dry(lake: list[Points], day_bgr: ByteArray) -> bool:
    """Return True if a lake is as red and bright as a salt flat in the day map, away from its shore."""
    height, width = day_bgr.shape[:2]
    latitude = np.concatenate(lake)[:, 1]
    north, south = 90.0 - latitude.max(), 90.0 - latitude.min()
    rows = range(max(int(north * height / 180.0) - 1, 0), min(int(south * height / 180.0) + 2, height))
    within = outlines(lake, width, height).filled(rows, width)
    inland = signed_distance(within) > _SHORE_PX
    if not inland.any():
        return False
    _, green, red = np.median(day_bgr[rows.start : rows.stop][inland], axis=0)
    return bool(red > max(_FLAT_RED, _FLAT_RED_TO_GREEN * green))


def coast_map(
    land: bytes, lakes: bytes, day_bgr: ByteArray, width: int = WIDTH, height: int = HEIGHT
) -> NDArray[np.uint8]:
    """Return (height, width) `COUNTS_PER_PIXEL` times the distance to the coast [pixels], plus 128.

    Parameters
    ----------
    land : bytes
        Shapefile of land polygons.
    lakes : bytes
        Shapefile of lake polygons, which are subtracted from the land.
    day_bgr : ByteArray
        Day map of the Earth, in which dry lakes are detected.
    width : int
        Width of the map [texels].
    height : int
        Height of the map [texels].
    """
    fine_width, fine_height, reach = SUBPIXELS * width, SUBPIXELS * height, SUBPIXELS * _REACH_PX
    filled = [lake for lake in polygons(lakes) if not is_dry(lake, day_bgr)]
    ground, water = (
        outlines(chain.from_iterable(shapes), fine_width, fine_height) for shapes in (polygons(land), filled)
    )
    out = np.empty((height, width), np.uint8)
    for start in range(0, height, _BAND_ROWS):
        rows = range(start, min(start + _BAND_ROWS, height))
        wide = range(max(SUBPIXELS * rows.start - reach, 0), min(SUBPIXELS * rows.stop + reach, fine_height))
        mask = ground.filled(wide, fine_width) & ~water.filled(wide, fine_width)
        distance = signed_distance(np.pad(mask, ((0, 0), (reach, reach)), mode="wrap"))
        skipped = SUBPIXELS * rows.start - wide.start
        distance = distance[skipped : skipped + SUBPIXELS * len(rows), reach:-reach]
        mean = cv2.resize(distance, (width, len(rows)), interpolation=cv2.INTER_AREA) / SUBPIXELS
        out[rows.start : rows.stop] = np.clip(np.round(128 + COUNTS_PER_PIXEL * mean), 0, 255)
    return out


def main() -> None:
    """Write the map."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("land", type=Path)
    parser.add_argument("lakes", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    chosen = parser.parse_args()
    image = coast_map(chosen.land.read_bytes(), chosen.lakes.read_bytes(), day_map())
    options = [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]
    chosen.output.write_bytes(cv2.imencode(".png", image, options)[1].tobytes())


if __name__ == "__main__":
    main()
