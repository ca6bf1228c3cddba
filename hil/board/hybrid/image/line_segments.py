"""Line segments of a region: Hough transforms of two edge images, and the line segment detector LSD."""

from __future__ import annotations

import cv2
import numpy as np

from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.svd.line_streams import (
    SH_GAP,
    SH_LENGTH,
    WGE_GAP,
    WGE_LENGTH,
    hough,
    stretch_contrast,
)
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients

Array = np.ndarray

# Settings of LSD (von Gioi et al. 2010): scale, blur [px of the scaled image], and least gradient, above which rounding
# to bytes cannot change the gradient angle by more than the tolerance of 22.5 degrees.
LSD_SCALE, LSD_SIGMA_PX, LSD_MIN_GRADIENT = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))


def wge_stream(image: Array, diagonal_px: float) -> Array:
    """Return the segments of a region after weak gradient elimination."""
    strong = eliminate_weak_gradients(image, cdf=0.9).strong
    return hough(strong, WGE_LENGTH * diagonal_px, WGE_GAP * diagonal_px)


def cleaned_stream(mask: Array, diagonal_px: float) -> Array:
    """Return the segments of thin edges after removing small components (the S&H stream of the Milan thesis)."""
    return hough(mask, max(8.0, SH_LENGTH * diagonal_px), max(2.0, SH_GAP * diagonal_px))


def lsd_stream(image: Array, shortest_px: float) -> Array:
    """Return the sub-pixel segments of the line segment detector."""
    scaled = stretch_contrast(image)
    if scaled is None:
        return np.zeros((0, 4))
    segments = _segments(_scaled(scaled)) / LSD_SCALE
    return segments[np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]) >= shortest_px]


def _scaled(picture: Array) -> Array:
    """Return the image at the detector's scale."""
    sigma = LSD_SIGMA_PX / LSD_SCALE
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=LSD_SCALE, fy=LSD_SCALE, interpolation=cv2.INTER_LINEAR_EXACT)


def _segments(picture: Array) -> Array:
    """Return the end points (N, 4) of the segments of a uint8 image [px, from the image's corner]."""
    pixels = contiguous(picture, "uint8")
    h, w = pixels.shape
    if min(h, w) < 2:
        return np.zeros((0, 4))
    # each segment has at least two pixels
    out = np.empty((h * w // 2, 4))
    count = library().fly_line_segments(pixels, h, w, LSD_MIN_GRADIENT, len(out), out)
    if count < 0:
        raise MemoryError("out of memory while detecting segments")
    return out[:count].copy()
