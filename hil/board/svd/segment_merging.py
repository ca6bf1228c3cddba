"""Merging of truncated and duplicate line segments.

Sharma, Ventura & D'Amico (2018), image processing, merging of the streams: segments of similar direction, offset and
position are one edge. The Milan thesis merges each stream separately before merging them all.
"""

from __future__ import annotations

from typing import List

import numpy as np

Array = np.ndarray

# Maximum angle between merged segments [rad]. A larger one merges neighbouring edges of a face, a smaller one leaves
# an edge in pieces.
ANGLE_RAD = np.radians(4.0)

# Offset and gap of merged segments, relative to the region's diagonal, and least offset [px]; chosen by eye.
OFFSET_SHARE, GAP_SHARE, MIN_OFFSET_PX = 0.01, 0.1, 2.0

# Longest segments that are looked at, and largest number returned. They bound the time.
MAX_SEGMENTS, MAX_MERGED = 400, 60


def merge_segments(segments: Array, diagonal_px: float, keep: int = MAX_MERGED) -> Array:
    """Merge segments of similar direction, offset and position; longest first.

    Parameters
    ----------
    segments : (N, 4) array
        End points x0 y0 x1 y1.
    diagonal_px : float
        Diagonal of the region, which scales the tolerances of offset and gap.
    keep : int, optional
        Maximum number of segments returned.

    Returns
    -------
    (M, 4) array
        Segments refitted by total least squares weighted by length.
    """
    s = np.asarray(segments, float).reshape(-1, 4)
    length = np.hypot(s[:, 2] - s[:, 0], s[:, 3] - s[:, 1])
    order = np.argsort(-length)[:MAX_SEGMENTS]
    s, length = s[order], length[order]
    s, length = s[length > 1e-6], length[length > 1e-6]
    offset_px, gap_px = max(MIN_OFFSET_PX, OFFSET_SHARE * diagonal_px), GAP_SHARE * diagonal_px
    free = np.ones(len(s), bool)
    out: List[Array] = []
    for i in range(len(s)):
        if not free[i]:
            continue
        current = s[i]
        members = np.zeros(len(s), bool)
        members[i] = True
        for attempt in range(2):
            near = free & _joinable(current, s, offset_px, gap_px)
            near[i] = True
            if attempt > 0 and np.array_equal(near, members):
                break
            members = near
            current = fit_line(s[members], length[members])
        free &= ~members
        out.append(current)
        if len(out) >= keep:
            break
    lines = np.array(out).reshape(-1, 4)
    return lines[np.argsort(-np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]))]


def _joinable(segment: Array, others: Array, offset_px: float, gap_px: float) -> Array:
    d = segment[2:] - segment[:2]
    length = float(np.hypot(*d))
    d = d / max(length, 1e-9)
    n = np.array([-d[1], d[0]])
    e = others[:, 2:] - others[:, :2]
    e = e / np.maximum(np.linalg.norm(e, axis=1, keepdims=True), 1e-9)
    parallel = np.abs(e @ n) < np.sin(ANGLE_RAD)
    a, b = others[:, :2] - segment[:2], others[:, 2:] - segment[:2]
    close = np.maximum(np.abs(a @ n), np.abs(b @ n)) < offset_px
    sa, sb = a @ d, b @ d
    low, high = np.minimum(sa, sb), np.maximum(sa, sb)
    gap = np.maximum(low - length, -high)
    return np.asarray(parallel & close & (gap < gap_px))


def fit_line(segments: Array, weight: Array) -> Array:
    """Fit a line (4,), from end to end, through segments by weighted total least squares."""
    points = segments.reshape(-1, 2)
    w = np.repeat(weight, 2)
    centre = (points * w[:, None]).sum(axis=0) / w.sum()
    # a longer segment has a larger spread of its ends, so its direction weighs more
    _, _, vt = np.linalg.svd((points - centre) * np.sqrt(w)[:, None], full_matrices=False)
    d = vt[0]
    along = (points - centre) @ d
    return np.concatenate([centre + along.min() * d, centre + along.max() * d])
