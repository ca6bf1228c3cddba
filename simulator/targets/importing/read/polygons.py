"""Triangulation of polygons: fans if they are convex, ear clipping otherwise.

References
----------
Meisters (1975), Polygons have ears. Newell's normal: Sutherland, Sproull, Schumacker (1974).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray

MAX_CORNERS, MAX_TESTS = 2000, 50
"""Limits of ear clipping, whose cost is quadratic: corners of a polygon, and triangles tested per corner."""


def fan(count: int) -> list[tuple[int, int, int]]:
    """Return the triangles between the first corner of a polygon and its other sides."""
    return [(0, k, k + 1) for k in range(1, count - 1)]


def are_convex(quads: FloatArray) -> BoolArray:
    """Return True for each quadrilateral (N, 4, 3) that may be cut along either diagonal."""
    with np.errstate(invalid="ignore", over="ignore"):
        normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
        sides = np.roll(quads, -1, axis=1) - quads
        turns = np.einsum("nkj,nj->nk", np.cross(np.roll(sides, 1, axis=1), sides), normal)
        return np.asarray(
            (turns >= -1e-12 * np.abs(turns).max(axis=1, initial=0.0, keepdims=True)).all(axis=1)
        )


def polygon_triangles(corners: FloatArray) -> list[tuple[int, int, int]]:
    """Cut a planar polygon into triangles with the same orientation.

    Parameters
    ----------
    corners : (N, 3) array
        Corners of the polygon, in order.

    Returns
    -------
    list of tuple of int
        Positions of the three corners of each triangle.

    Raises
    ------
    ValueError
        If it is concave and has too many corners.
    """
    n = len(corners)
    flat = _projected(corners)
    turns = _turn(np.roll(flat, 1, axis=0), flat, np.roll(flat, -1, axis=0))
    if not np.isfinite(flat).all() or (turns >= -1e-12 * np.abs(turns).max()).all():
        return fan(n)
    out, remaining, tests = [], list(range(n)), MAX_TESTS * n
    while len(remaining) > 3:
        k, n_tests = _ear(flat, remaining)
        tests -= n_tests
        if n > MAX_CORNERS or tests < 0:
            raise ValueError(f"a concave polygon of {n:,} corners")
        if k < 0:  # the outline crosses itself
            return fan(n)
        out.append((remaining[k - 1], remaining[k], remaining[(k + 1) % len(remaining)]))
        del remaining[k]
    return [*out, (remaining[0], remaining[1], remaining[2])]


def _ear(flat: FloatArray, remaining: list[int]) -> tuple[int, int]:
    """Return the index in ``remaining`` of a corner whose triangle is empty, or -1, and the number of tests."""
    p = flat[remaining]
    previous, following = np.roll(p, 1, axis=0), np.roll(p, -1, axis=0)
    n_tests = 0
    for n_tests, k in enumerate(np.flatnonzero(_turn(previous, p, following) > 0), 1):
        a, b, c = previous[k], p[k], following[k]
        is_inside = (_turn(a, b, p) >= 0) & (_turn(b, c, p) >= 0) & (_turn(c, a, p) >= 0)
        # the triangle's own corners do not count as inside
        is_corner = (p == a).all(axis=1) | (p == b).all(axis=1) | (p == c).all(axis=1)
        if not (is_inside & ~is_corner).any():
            return int(k), n_tests
    return -1, n_tests


def _projected(corners: FloatArray) -> FloatArray:
    """Project corners to the plane of Newell's normal, (N, 2), counter-clockwise."""
    p = corners - corners.mean(axis=0)
    normal = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    u, v = ((1, 2), (2, 0), (0, 1))[axis]
    return p[:, [u, v]] if normal[axis] >= 0 else p[:, [v, u]]


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return (N,) twice the signed areas of triangles."""
    return np.asarray(
        (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    )
