"""Straight line segments of a region: Hough transforms of two edge images, and LSD."""

from __future__ import annotations

import cv2
import numpy as np

from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.svd.line_streams import SH_GAP, SH_LENGTH, WGE_GAP, WGE_LENGTH, hough, stretched
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients

Array = np.ndarray

# Settings of the line segment detector (von Gioi et al. 2010): scale, blur [px of the scaled image], and least
# gradient, which rounding to bytes cannot turn by the angular tolerance.
REDUCED, SIGMA, LEAST = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))


def wge_stream(image: Array, diagonal_px: float) -> Array:
    """Return the segments of a region after weak gradient elimination."""
    strong = eliminate_weak_gradients(image, cdf=0.9).strong
    return hough(strong, WGE_LENGTH * diagonal_px, WGE_GAP * diagonal_px)


def cleaned_stream(mask: Array, diagonal_px: float) -> Array:
    """Return the segments of thin edges without small components (the thesis's S&H stream)."""
    return hough(mask, max(8.0, SH_LENGTH * diagonal_px), max(2.0, SH_GAP * diagonal_px))


def lsd_stream(image: Array, shortest_px: float) -> Array:
    """Return sub-pixel segments by the line segment detector."""
    scaled = stretched(image)
    if scaled is None:
        return np.zeros((0, 4))
    segments = _segments(_reduced(scaled)) / REDUCED
    return segments[np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]) >= shortest_px]


def _reduced(picture: Array) -> Array:
    """Return the image scaled as in the line segment detector."""
    sigma = SIGMA / REDUCED
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=REDUCED, fy=REDUCED, interpolation=cv2.INTER_LINEAR_EXACT)


def _segments(picture: Array) -> Array:
    """Return the end points (N, 4) of segments of a uint8 image [px, half a pixel right of and below pixel centres]."""
    pixels = contiguous(picture, "uint8")
    h, w = pixels.shape
    if min(h, w) < 2:
        return np.zeros((0, 4))
    # each has two pixels at least
    out = np.empty((h * w // 2, 4))
    count = library().fly_line_segments(pixels, h, w, LEAST, len(out), out)
    if count < 0:
        raise MemoryError("no memory to find segments")
    return out[:count].copy()
