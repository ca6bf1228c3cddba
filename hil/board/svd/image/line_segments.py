"""Streams of straight line segments found in a region: Hough on two edge images, and LSD."""

from __future__ import annotations

import cv2
import numpy as np

from flyaround.hil.board.svd.image.weak_gradients import eliminate_weak_gradients
from flyaround.hil.board.svd.native.interface import contiguous
from flyaround.hil.board.svd.native.library import is_available, library

Array = np.ndarray

# Share of the region's diagonal: least length and largest gap of each stream (svd.md, stage 3).
WGE_LENGTH, WGE_GAP = 0.15, 0.03
SH_LENGTH, SH_GAP = 0.05, 0.01

# The line segment detector's own settings: what it reduces an image to, its blur [px of that], and the least gradient
# that rounding to bytes cannot turn by its tolerance of directions.
REDUCED, SIGMA, LEAST = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))


def hough(mask: Array, min_length_px: float, max_gap_px: float) -> Array:
    """(N, 4) segments x0 y0 x1 y1 by the probabilistic Hough transform, 1 px and 0.5 deg."""
    votes = int(max(12, 0.6 * min_length_px))
    found = cv2.HoughLinesP(
        mask.astype(np.uint8) * 255,
        1.0,
        np.radians(0.5),
        votes,
        minLineLength=float(min_length_px),
        maxLineGap=float(max(1.0, max_gap_px)),
    )
    # OpenCV 4 returns (N, 1, 4), OpenCV 5 (N, 4), both None when there is nothing
    return np.zeros((0, 4)) if found is None else np.asarray(found, float).reshape(-1, 4)


def wge_stream(image: Array, diagonal_px: float) -> Array:
    """Segments of what weak gradient elimination leaves of a region."""
    strong = eliminate_weak_gradients(image, cdf=0.9).strong
    return hough(strong, WGE_LENGTH * diagonal_px, WGE_GAP * diagonal_px)


def cleaned_stream(mask: Array, diagonal_px: float) -> Array:
    """Segments of the thin edges that are left without small components (the thesis's S&H stream)."""
    return hough(mask, max(8.0, SH_LENGTH * diagonal_px), max(2.0, SH_GAP * diagonal_px))


def lsd_stream(image: Array, shortest_px: float) -> Array:
    """Sub-pixel segments by the line segment detector; none without the library where OpenCV was built without it."""
    low, high = float(image.min()), float(np.percentile(image[::2, ::2], 99.5))
    if high <= low:
        return np.zeros((0, 4))
    scaled = np.clip((image - low) * (255.0 / (high - low)), 0, 255).astype(np.uint8)
    segments = _segments(_reduced(scaled)) / REDUCED if is_available() else _opencv_segments(scaled)
    return segments[np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]) >= shortest_px]


def _reduced(picture: Array) -> Array:
    """The image as the line segment detector reduces it."""
    sigma = SIGMA / REDUCED
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=REDUCED, fy=REDUCED, interpolation=cv2.INTER_LINEAR_EXACT)


def _segments(picture: Array) -> Array:
    """(N, 4) ends of segments of a picture of bytes [px, half a pixel right and down of the places of pixels]."""
    given = contiguous(picture, "uint8")
    h, w = given.shape
    if min(h, w) < 2:
        return np.zeros((0, 4))
    # each has two pixels at least
    out = np.empty((h * w // 2, 4))
    found = library().fly_line_segments(given, h, w, LEAST, len(out), out)
    if found < 0:
        raise MemoryError("no memory to find segments")
    return out[:found].copy()


def _opencv_segments(picture: Array) -> Array:
    """(N, 4) segments by OpenCV: the published methods need no library."""
    try:
        found = cv2.createLineSegmentDetector().detect(picture)[0]
    except (cv2.error, AttributeError):
        # removed from 3.4.6-3.4.15 and 4.1.0-4.5.3 for its licence
        return np.zeros((0, 4))
    # None when there is nothing, which OpenCV's stubs do not say
    return np.asarray([] if np.ndim(found) == 0 else found, float).reshape(-1, 4)
