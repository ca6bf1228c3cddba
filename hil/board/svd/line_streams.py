"""Feature streams of a region: lines by Hough transforms of two edge images, and other detectors.

Sharma, Ventura & D'Amico (2018), image processing: the first stream is a Hough transform of the edges left by WGE, the
second one (S&H) of Sobel edges; ``rho = x cos(theta) + y sin(theta)`` in steps of 1 px and 0.5 deg, with lengths and
gaps as shares of the region's diagonal. The Milan thesis removes small components of the Sobel edges first. ``lsd``,
``harris`` and ``ellipse`` are options suggested in its outlook.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.svd.ellipses import EllipseFit, hough_ellipses
from flyaround.hil.board.svd.region_of_interest import Region, crop_of, grown_region
from flyaround.hil.board.svd.segment_merging import merge_segments
from flyaround.hil.board.svd.settings import PublishedConfig
from flyaround.hil.board.svd.weak_gradients import WeakGradientElimination, prewitt

Array = np.ndarray

# Shares of the region's diagonal: minimum length and largest gap of a line in each stream.
WGE_LENGTH, WGE_GAP = 0.15, 0.03
SH_LENGTH, SH_GAP = 0.05, 0.01

# Votes of a line relative to its minimum length, for edges with gaps, and for the shortest lines: a dozen pixels in a
# row are rare among noise. Chosen by hand, as the paper gives none.
VOTES_OF_LENGTH, MIN_VOTES = 0.6, 12

# Blur before both gradients [px]. The published sigma is not given; noise of 5 % of full scale requires this.
BLUR_PX = 1.5

# Largest number of lines after merging. Pairs of lines, and so the time to group them, grow with its square.
MAX_LINES = 40

# Margin of the line search around the region, share of its diagonal: lines that leave the region keep their true ends.
SEARCH_MARGIN = 0.25

# Number of Harris corners, Harris's sensitivity parameter (usually 0.04 to 0.06), and minimum response
# relative to the strongest corner. The minimum matters only if fewer than HARRIS_CORNERS exceed it.
HARRIS_CORNERS, HARRIS_K, HARRIS_MIN = 60, 0.04, 0.01

# Window of Harris's sums, and reach of the search for its peaks [px]: a corner blurred by BLUR_PX, and the next one.
HARRIS_WINDOW_PX, HARRIS_PEAK_PX = 5, 9

# The LSD stream: blur [px], and minimum length [share of the diagonal], as of S&H's lines.
LSD_BLUR_PX, LSD_LENGTH = 1.0, 0.04

# OpenCV's LSD works on the image reduced by 0.8 and divides its coordinates by this scale. Pixel centres are half a
# pixel from the corners that scaling maps onto each other: (x' + 0.5) / 0.8 - 0.5 = x' / 0.8 + 0.125 [px].
LSD_SHIFT_PX = 0.125


@dataclass(frozen=True, eq=False)
class Streams:
    """Output of the feature streams, in full-resolution pixels.

    Parameters
    ----------
    lines : (N, 4) array
        Segments after merging all streams.
    by_name : dict of str to array
        Segments of each stream.
    corners : (C, 2) array
        Harris corners.
    ellipses : tuple of EllipseFit
        Ellipses of round bodies.
    region : Region, optional
        Region, enlarged if the method does so; edges outside it are dropped.
    merged : dict of str to array, optional
        Segments of each stream after its own merging, if the method merges streams separately.
    """

    lines: Array
    by_name: Dict[str, Array]
    corners: Array
    ellipses: Tuple[EllipseFit, ...]
    region: Region
    merged: Dict[str, Array] = field(default_factory=dict)


def thin(mask: Array, magnitude: Array, gx: Array, gy: Array) -> Array:
    """Return the pixels of a mask that are local maxima across the larger gradient component: one-pixel-wide edges."""
    h, w = magnitude.shape
    out = np.zeros(mask.shape, bool)
    # few pixels are set: index them instead of processing the whole image
    flat = np.flatnonzero(mask)
    y, x = np.divmod(flat, w)
    m, gx, gy = magnitude.ravel(), gx.ravel()[flat], gy.ravel()[flat]
    steep = np.abs(gx) >= np.abs(gy)
    inside = np.where(steep, (x > 0) & (x < w - 1), (y > 0) & (y < h - 1))
    flat, step = flat[inside], np.where(steep, 1, w)[inside]
    values = m[flat]
    out.ravel()[flat] = (values > m[flat - step]) & (values >= m[flat + step])
    return out


def sobel_edges(image: Array, threshold: Optional[float] = None) -> Array:
    """Return thinned Sobel edges with a squared magnitude above ``threshold``, default `sobel_threshold`."""
    gx, gy = _sobel(image)
    b = gx * gx + gy * gy
    # `sobel_threshold` is twice the RMS, so four times the mean square
    return thin(b > (4.0 * float(b.mean()) if threshold is None else threshold), b, gx, gy)


def sobel_threshold(image: Array) -> float:
    """Return the customary threshold, four times the mean squared magnitude over the whole image.

    Within the region alone, one saturated part would raise the threshold above the other edges of the craft.
    """
    gx, gy = _sobel(image)
    return 4.0 * float(cv2.mean(gx * gx + gy * gy)[0])


def _sobel(image: Array) -> Tuple[Array, Array]:
    blurred = cv2.GaussianBlur(image, (0, 0), BLUR_PX)
    return cv2.Sobel(blurred, cv2.CV_32F, 1, 0), cv2.Sobel(blurred, cv2.CV_32F, 0, 1)


def wge_edges(image: Array, strong: Array) -> Array:
    """Return the thinned edges left by weak gradient elimination: Hough would find many lines in a wide band."""
    blurred = cv2.GaussianBlur(image, (0, 0), BLUR_PX)
    gx, gy = prewitt(blurred)
    return thin(strong, gx * gx + gy * gy, gx, gy)


def hough(mask: Array, min_length_px: float, max_gap_px: float) -> Array:
    """Return segments (N, 4) x0 y0 x1 y1 of the probabilistic Hough transform, 1 px and 0.5 deg."""
    votes = int(max(MIN_VOTES, VOTES_OF_LENGTH * min_length_px))
    lines = cv2.HoughLinesP(
        mask.astype(np.uint8) * 255,
        1.0,
        np.radians(0.5),
        votes,
        minLineLength=float(min_length_px),
        maxLineGap=float(max(1.0, max_gap_px)),
    )
    # OpenCV 4 returns (N, 1, 4), OpenCV 5 (N, 4), both None without a result
    return np.zeros((0, 4)) if lines is None else np.asarray(lines, float).reshape(-1, 4)


def remove_specks(mask: Array, smallest: int) -> Array:
    """Return the mask without connected components smaller than ``smallest`` pixels."""
    rows, columns = (np.flatnonzero(mask.any(axis=k)) for k in (1, 0))
    if not len(rows):
        return mask
    # in front of empty space most of the image is empty
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    part = mask[box].astype(bool)
    # counting edge pixels alone is faster than the statistics of all pixels
    pixel = np.flatnonzero(part)
    label: Array = cv2.connectedComponents(part.view(np.uint8), connectivity=8)[1].ravel().take(pixel)
    part.ravel()[pixel] = (np.bincount(label) >= smallest).take(label)
    out = np.zeros_like(mask)
    out[box] = part
    return out


def stretch_contrast(image: Array) -> Optional[Array]:
    """Return an image stretched to uint8, with the brightest half per cent clipped; None if it is constant."""
    low, high = float(image.min()), float(np.percentile(image[::2, ::2], 99.5))
    return np.clip((image - low) * (255.0 / (high - low)), 0, 255).astype(np.uint8) if high > low else None


def lsd_lines(image: Array, shortest_px: float) -> Array:
    """Return sub-pixel segments (N, 4) of OpenCV's line segment detector; none if OpenCV was built without it."""
    scaled = stretch_contrast(image)
    if scaled is None:
        return np.zeros((0, 4))
    try:
        segments = cv2.createLineSegmentDetector().detect(scaled)[0]
    except (cv2.error, AttributeError):
        # removed from 3.4.6-3.4.15 and 4.1.0-4.5.3 for licensing reasons
        return np.zeros((0, 4))
    # None without a result, which OpenCV's type stubs omit
    lines = np.asarray([] if np.ndim(segments) == 0 else segments, float).reshape(-1, 4) + LSD_SHIFT_PX
    return lines[np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]) >= shortest_px]


def harris_corners(image: Array, origin: Tuple[float, float]) -> Array:
    """Return corners (C, 2) of Harris and Stephens (1988), sub-pixel by a parabola through the response."""
    blurred = cv2.GaussianBlur(image, (0, 0), BLUR_PX)
    response = cv2.cornerHarris(blurred, HARRIS_WINDOW_PX, 3, HARRIS_K)
    top = float(response.max())
    if top <= 0:
        return np.zeros((0, 2))
    around = np.ones((HARRIS_PEAK_PX, HARRIS_PEAK_PX), np.uint8)
    peak = (response == cv2.dilate(response, around)) & (response > HARRIS_MIN * top)
    peak[:2], peak[-2:], peak[:, :2], peak[:, -2:] = False, False, False, False
    ys, xs = np.nonzero(peak)
    order = np.argsort(-response[ys, xs])[:HARRIS_CORNERS]
    ys, xs = ys[order], xs[order]
    dx = _parabola(response[ys, xs - 1], response[ys, xs], response[ys, xs + 1])
    dy = _parabola(response[ys - 1, xs], response[ys, xs], response[ys + 1, xs])
    return np.stack([xs + dx, ys + dy], axis=-1) + origin


def _parabola(a: Array, b: Array, c: Array) -> Array:
    curve = a - 2 * b + c
    return np.clip(0.5 * (a - c) / np.where(np.abs(curve) < 1e-12, -1e-12, curve), -0.5, 0.5)


def find_streams(
    image: Array, wge: WeakGradientElimination, region: Region, config: PublishedConfig
) -> Streams:
    """Return the streams of ``config`` in a region; edges outside it are not computed.

    Parameters
    ----------
    image : (H, W) array
        Whole image, float32.
    wge : WeakGradientElimination
        Strong gradients of the whole image.
    region : Region
        Region of interest.
    config : PublishedConfig
        Settings of the published method.
    """
    diagonal = region.diagonal_px
    rows, cols = crop_of(region, image, SEARCH_MARGIN * diagonal)
    origin = (float(cols.start), float(rows.start))
    shift = np.array([*origin, *origin])
    crop = np.ascontiguousarray(image[rows, cols])
    sobel = sobel_edges(crop, sobel_threshold(image))
    if config.least_component:
        sobel = remove_specks(sobel, int(max(4, config.least_component * diagonal)))
    streams: Dict[str, Array] = {}
    if "wge" in config.streams:
        edges = wge_edges(crop, wge.strong[rows, cols])
        streams["wge"] = hough(edges, WGE_LENGTH * diagonal, WGE_GAP * diagonal) + shift
    if "sh" in config.streams:
        streams["sh"] = hough(sobel, SH_LENGTH * diagonal, SH_GAP * diagonal) + shift
    if "lsd" in config.streams:
        streams["lsd"] = lsd_lines(cv2.GaussianBlur(crop, (0, 0), LSD_BLUR_PX), LSD_LENGTH * diagonal) + shift
    grown = grown_region(region, _concatenate(streams), config.roi_growth, image.shape)
    streams = {name: lines[_inside(lines, grown)] for name, lines in streams.items()}
    merged = {
        name: merge_segments(s, diagonal, keep=MAX_LINES) if name in config.merge_each or name == "lsd" else s
        for name, s in streams.items()
    }
    lines = merge_segments(_concatenate(merged), diagonal, keep=MAX_LINES)
    corners = np.zeros((0, 2))
    if "harris" in config.streams:
        rows, cols = crop_of(region, image)
        corners = harris_corners(
            np.ascontiguousarray(image[rows, cols]), (float(cols.start), float(rows.start))
        )
    ellipses = hough_ellipses(sobel, origin, diagonal) if "ellipse" in config.streams else ()
    own = {name: s for name, s in merged.items() if s is not streams[name]}
    return Streams(lines, streams, corners, ellipses, grown, own)


def _concatenate(segments: Dict[str, Array]) -> Array:
    return np.concatenate([np.zeros((0, 4)), *segments.values()])


def _inside(lines: Array, region: Region) -> Array:
    """Return a mask (N,) of the lines (N, 4) whose midpoint is in the region."""
    x, y = 0.5 * (lines[:, 0] + lines[:, 2]), 0.5 * (lines[:, 1] + lines[:, 3])
    return np.asarray((x >= region.x0) & (x <= region.x1) & (y >= region.y0) & (y <= region.y1))
