"""Straight line segments of an image, in C."""

from __future__ import annotations

import ctypes

import cv2
import numpy as np

from hil.board.svd.native.arrays import checked_pointer, contiguous

Array = np.ndarray

# The line segment detector's own settings: what it reduces a picture to, its blur [px of that], and the least gradient
# that rounding to bytes cannot turn by its tolerance of directions.
REDUCED, SIGMA, LEAST = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))


def detect_segments(library: ctypes.CDLL, picture: Array) -> Array:
    """As ``line_segments._lsd``: (N, 4) segments of a picture of bytes, sub-pixel."""
    return segments(library, _reduced(picture), LEAST) / REDUCED


def _reduced(picture: Array) -> Array:
    """A picture of bytes as the line segment detector reduces it."""
    sigma = SIGMA / REDUCED
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=REDUCED, fy=REDUCED, interpolation=cv2.INTER_LINEAR_EXACT)


def segments(library: ctypes.CDLL, picture: Array, least: float) -> Array:
    """(N, 4) ends x0 y0 x1 y1 of straight segments [px, half a pixel right and down of the places of pixels].

    Parameters
    ----------
    picture : (H, W) of bytes; none are found in a single row or column. least : gradient that counts [1 / px].
    """
    given = contiguous(picture, "uint8")
    h, w = given.shape
    if min(h, w) < 2:
        return np.zeros((0, 4))
    # none has fewer than two pixels
    out = np.empty((h * w // 2, 4))
    run = library.fly_line_segments
    run.restype = ctypes.c_int64
    found = run(
        ctypes.c_void_p(checked_pointer(given, "uint8")),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_double(least),
        ctypes.c_int64(len(out)),
        ctypes.c_void_p(checked_pointer(out, "float64")),
    )
    if found < 0:
        raise MemoryError("no memory to find segments")
    return out[:found].copy()
