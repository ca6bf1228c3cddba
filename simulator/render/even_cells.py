"""Cells of the image that no edge of a mesh comes near: each shows one face, or nothing of the mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.render.cover import CELL_PX

if TYPE_CHECKING:
    from simulator.arrays import BoolArray, FloatArray
    from simulator.render.projection import PixelRect

_SHIFT = 4  # bits of an end's fraction
_FARTHEST = 1 << 20  # OpenCV's corners must fit in whole numbers with the fraction's bits to spare


def crossed_cells(lines_px: FloatArray, rect: PixelRect) -> BoolArray:
    """(rows, columns) of the cells of a rectangle that lines of the image cross, or pass by at half a pixel.

    Parameters
    ----------
    lines_px : (N, 2, 2) column and row of both ends of each. rect : begins at whole cells.
    """
    rows, columns = -(-rect.height // CELL_PX), -(-rect.width // CELL_PX)
    # one pixel more on each side: what passes there reaches inside
    mask = np.zeros((rows * CELL_PX + 2, columns * CELL_PX + 2), np.uint8)
    at = np.clip(lines_px - [rect.x0 - 1, rect.y0 - 1], -_FARTHEST, _FARTHEST)
    cv2.polylines(mask, np.rint(at * (1 << _SHIFT)).astype(np.int32), False, 1, shift=_SHIFT)  # type: ignore[call-overload]
    # the pixels drawn have their middles within half a pixel of the line
    cv2.dilate(mask, np.ones((3, 3), np.uint8), dst=mask)
    inner = mask[1:-1, 1:-1].reshape(rows, CELL_PX, -1).max(axis=1)  # one axis after the other is quicker
    return np.asarray(np.ascontiguousarray(inner).view(np.uint64) != 0)
