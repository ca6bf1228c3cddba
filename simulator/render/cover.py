"""Which pixels the target may touch, in cells of 8 x 8: elsewhere no sample is gathered.

The craft is the union of its parts and each part lies in its convex hull; the hulls' pictures, filled one over the
other, hold the craft's closely: antennas and panels leave open what is between them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.arrays import BoolArray, FloatArray
    from simulator.render.projection import PixelRect

CELL_PX = 8
_MASK_PX = 2  # of the picture that the hulls are filled into
_SHIFT = 4  # bits of a corner's fraction there
_FARTHEST = 1 << 14  # OpenCV's corners must fit in whole numbers with the fraction's bits to spare


def whole(rect: PixelRect) -> FloatArray:
    """Centres (K, 2) [px] of all the cells of a rectangle that begins at whole cells."""
    return _centers(np.ones((-(-rect.height // CELL_PX), -(-rect.width // CELL_PX)), bool), rect)


def hulls_cover(rect: PixelRect, parts_px: Sequence[FloatArray]) -> FloatArray:
    """Centres (K, 2) [px] of the cells of a rectangle that some convex hulls touch, and a few more.

    Parameters
    ----------
    rect : begins at whole cells. parts_px : (K, 2) projected points of each hull.
    """
    rows, columns = -(-rect.height // CELL_PX), -(-rect.width // CELL_PX)
    step = CELL_PX // _MASK_PX
    # one more on each side: what ends there may touch a pixel inside
    mask = np.zeros((rows * step + 2, columns * step + 2), np.uint8)
    # mask pixel (1, 1) is the mean of image pixels x0 and x0 + 1
    origin = np.array([rect.x0, rect.y0]) + 0.5 * (_MASK_PX - 1) - _MASK_PX
    for points in parts_px:
        at = np.clip((points - origin) / _MASK_PX, -_FARTHEST, _FARTHEST)
        hull = cv2.convexHull(at.astype(np.float32))
        cv2.fillConvexPoly(mask, np.rint(hull * (1 << _SHIFT)).astype(np.int32), 1, shift=_SHIFT)
    # a pixel whose corner is touched counts, and OpenCV's fill leaves out what it touches by less than half
    cv2.dilate(mask, np.ones((3, 3), np.uint8), dst=mask)
    return _centers(mask[1:-1, 1:-1].reshape(rows, step, columns, step).max(axis=(1, 3)) > 0, rect)


def _centers(cells: BoolArray, rect: PixelRect) -> FloatArray:
    row, column = np.nonzero(cells)
    middle = (CELL_PX - 1) / 2
    return np.stack([column, row], axis=1) * CELL_PX + [rect.x0 + middle, rect.y0 + middle]
