"""Mask statistics without `numpy.argwhere` and `numpy.isin`, which are slower."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.labels.truth import Box
    from flyaround.simulator.runtime.arrays import ByteArray, IntArray


def is_binary(mask: ByteArray) -> bool:
    """Return True if a mask consists of bytes that are 0 or 255."""
    # 255 and 0 become 0 and 1, everything else becomes larger
    if mask.dtype != np.uint8:
        return False
    return mask.size == 0 or int((mask + np.uint8(1)).max()) <= 1


def nonzero_pixels(mask: ByteArray) -> IntArray:
    """Return (K, 2) non-zero pixels x, y of a mask (H, W), row by row from the top."""
    pixels = cv2.findNonZero(np.ascontiguousarray(mask)) if mask.size else None
    return np.zeros((0, 2), np.int64) if pixels is None else pixels.reshape(-1, 2).astype(np.int64)


def box_with_opencv(mask: ByteArray) -> Box | None:
    """Return the bounding box x0, y0, x1, y1 of a mask at pixel edges [px], or None, independently of `mask_box`."""
    x, y, width, height = cv2.boundingRect((mask > 0).astype(np.uint8))
    return (x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5) if width else None
