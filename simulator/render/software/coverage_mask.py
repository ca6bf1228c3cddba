"""Which pixels the target may touch, in tiles of 8 x 8: elsewhere no sample is gathered.

The craft is the union of its parts and each part lies in its convex hull; the hulls' pictures, filled one over the
other, hold the craft's closely: antennas and panels leave open what is between them. Worth 53 ms of 800.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.render.craft.viewport_fit import TILE_PX, all_tiles, tile_centers

if TYPE_CHECKING:
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

_MASK_PX = 2  # of the picture that the hulls are filled into
_FOUR_BYTES = np.uint32  # a tile's row there
_SHIFT = 4  # bits of a corner's fraction there
_AROUND = np.ones((3, 3), np.uint8)
_FARTHEST = 1 << 14  # OpenCV's corners must fit in whole numbers with the fraction's bits to spare


def target_tiles(place: ViewportFit) -> FloatArray:
    """Centres (K, 2) [px] of the tiles that the target may touch; all of its rectangle, if part of it is behind."""
    if place.hull_px is None:
        return all_tiles(place.rect)
    return hull_tiles(place.rect, place.hull_px, place.hull_parts)


def hull_tiles(rect: PixelRect, points_px: FloatArray, parts: IntArray) -> FloatArray:
    """Centres (K, 2) [px] of the tiles of a rectangle that some convex hulls touch, and a few more.

    Parameters
    ----------
    rect : begins at whole tiles. points_px : (2, K) projected points of all hulls, one hull after the other.
    parts : where the points of the second hull begin, of the third and so on.
    """
    rows, columns = -(-rect.height // TILE_PX), -(-rect.width // TILE_PX)
    step = TILE_PX // _MASK_PX
    # one more on each side: what ends there may touch a pixel inside
    mask = np.zeros((rows * step + 2, columns * step + 2), np.uint8)
    # mask pixel (1, 1) is the mean of image pixels x0 and x0 + 1
    fixed = np.empty((points_px.shape[1], 2), np.int32)
    for axis, first in enumerate((rect.x0, rect.y0)):
        at = (points_px[axis] - (first + 0.5 * (_MASK_PX - 1) - _MASK_PX)) / _MASK_PX
        fixed[:, axis] = np.rint(np.minimum(np.maximum(at, -_FARTHEST), _FARTHEST) * (1 << _SHIFT))
    ends = [0, *parts.tolist(), len(fixed)]
    for start, end in itertools.pairwise(ends):
        cv2.fillConvexPoly(mask, cv2.convexHull(fixed[start:end]), 1, shift=_SHIFT)
    # a pixel whose corner is touched counts, and OpenCV's fill leaves out what it touches by less than half
    cv2.dilate(mask, _AROUND, dst=mask)
    inner = mask[1:-1, 1:-1].reshape(rows, step, -1).max(axis=1)  # one axis after the other is quicker
    return tile_centers(inner.view(_FOUR_BYTES) != 0, rect)
