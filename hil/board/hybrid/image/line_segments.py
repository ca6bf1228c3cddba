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

# Settings of LSD (von Gioi et al. 2010): scale, blur [px of the reduced image], and least gradient, above which
# rounding to bytes cannot change the gradient angle by more than the tolerance of 22.5 degrees.
LSD_SCALE, LSD_SIGMA_PX, LSD_MIN_GRADIENT = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))

# Value of the fitted distribution at the threshold of the gradients. The published 0.99 is meant for a whole image. In
# a region the target's own edges double the mean gradient, and 0.9 gives the threshold that 0.99 gives in the whole.
REGION_CDF = 0.9

# Lower bounds in small regions [px]. A shorter segment of one-pixel-wide edges has a direction uncertain by more than
# one pixel in eight, 7 degrees; a gap of 2 px between neighbours is a single missing pixel.
MIN_LENGTH_PX, MIN_GAP_PX = 8.0, 2.0


def wge_stream(image: Array, diagonal_px: float) -> Array:
    """Return the segments (N, 4) of a region after weak gradient elimination."""
    strong = eliminate_weak_gradients(image, cdf=REGION_CDF).strong
    return hough(strong, WGE_LENGTH * diagonal_px, WGE_GAP * diagonal_px)


def thin_edge_stream(edges: Array, diagonal_px: float) -> Array:
    """Return the segments (N, 4) of the thinned edges of a region, with the lengths and gaps of the S&H stream.

    Parameters
    ----------
    edges : (h, w) array
        True at one-pixel-wide edges.
    diagonal_px : float
        Diagonal of the region [px].
    """
    return hough(edges, max(MIN_LENGTH_PX, SH_LENGTH * diagonal_px), max(MIN_GAP_PX, SH_GAP * diagonal_px))


def lsd_stream(image: Array, shortest_px: float) -> Array:
    """Return the sub-pixel segments (N, 4) of the line segment detector, from the centre of the first pixel [px]."""
    stretched = stretch_contrast(image)
    if stretched is None:
        return np.zeros((0, 4))
    # scaling maps pixel corners, which are half a pixel from the centres, onto each other
    segments = (_segments(_reduced(stretched)) + 0.5) / LSD_SCALE - 0.5
    return segments[np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]) >= shortest_px]


def _reduced(picture: Array) -> Array:
    """Return the image blurred and reduced by ``LSD_SCALE``."""
    sigma = LSD_SIGMA_PX / LSD_SCALE
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=LSD_SCALE, fy=LSD_SCALE, interpolation=cv2.INTER_LINEAR_EXACT)


def _segments(picture: Array) -> Array:
    """Return the end points (N, 4) of the segments of a uint8 image, from the centre of its first pixel [px]."""
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
