"""Tiles of the image that no edge of a mesh comes near: each shows one face, or nothing of the mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.target.viewport_fit import TILE_PX

if TYPE_CHECKING:
    from simulator.render.projection import PixelRect
    from simulator.runtime.arrays import BoolArray, Float32Array, FloatArray

_NEAR_PX = 0.25
"""How near to a tile's outermost pixels a line passes that counts as crossing it; those are whole squares, with all of
their samples, so that this is for roundings alone."""
_LEVEL = 1e-6  # tiles: a line that rises by less is level


def crossed_tiles(lines_px: FloatArray, rect: PixelRect) -> BoolArray:
    """(rows, columns) of the tiles of a rectangle that lines of the image cross, or pass by at `_NEAR_PX`.

    Each line is cut where rows of tiles begin, and what lies in a row marks the tiles from its left end to its right:
    a sixth of the time in which OpenCV draws the lines into a picture.

    Parameters
    ----------
    lines_px : (N, 2, 2) column and row of both ends of each, finite and nearer than 1e6 px: farther off 32-bit floats
        round by more than the margin. rect : begins at whole tiles.
    """
    rows, columns = -(-rect.height // TILE_PX), -(-rect.width // TILE_PX)
    x, y = _in_tiles(lines_px, rect)
    near = np.float32(_NEAR_PX / TILE_PX)
    upper = y.argmin(axis=0)[None]
    x0, y0, x1, y1 = (np.take_along_axis(v, end, axis=0)[0] for end in (upper, 1 - upper) for v in (x, y))
    first = np.clip(np.floor(y0 - near), 0, rows).astype(np.int64)
    last = np.clip(np.floor(y1 + near), -1, rows - 1).astype(np.int64)
    counts = np.maximum(last - first + 1, 0)
    # a piece for each row of tiles that a line reaches
    of = np.repeat(np.arange(len(counts)), counts)
    row = np.arange(len(of)) - (np.cumsum(counts) - counts - first).take(of)
    slope, start = ((x1 - x0) / np.maximum(y1 - y0, np.float32(_LEVEL))).take(of), x0.take(of)
    above = row.astype(np.float32) - y0.take(of)
    enters, leaves = start + slope * (above - near), start + slope * (above + (1 + near))
    left = np.maximum(np.minimum(enters, leaves), np.minimum(x0, x1).take(of)) - near
    right = np.minimum(np.maximum(enters, leaves), np.maximum(x0, x1).take(of)) + near
    begin = np.clip(np.floor(left), 0, columns).astype(np.int64)
    end = np.clip(np.floor(right) + 1, 0, columns).astype(np.int64)
    met = np.flatnonzero(end > begin)
    width, at = columns + 1, row.take(met) * (columns + 1)
    begun = np.bincount(at + begin.take(met), minlength=rows * width)
    ended = np.bincount(at + end.take(met), minlength=rows * width)
    return np.asarray(np.cumsum((begun - ended).reshape(rows, width), axis=1)[:, :columns] > 0)


def _in_tiles(lines_px: FloatArray, rect: PixelRect) -> Float32Array:
    """(2, 2, N) columns and rows of both ends in tiles, from the rectangle's upper left corner."""
    corner = np.array([rect.x0 - 0.5, rect.y0 - 0.5])[:, None, None]
    return np.asarray((lines_px.transpose(2, 1, 0) - corner) / TILE_PX, np.float32)
