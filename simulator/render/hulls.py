"""The convex hulls of a craft's parts: what says, before anything is drawn, where in the image the craft can be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.runtime.arrays import FloatArray

_ROUNDING = 1e-9  # of a hull's extent, by which one inside of it may stand out


def outer_hulls(parts_m: Sequence[FloatArray]) -> list[FloatArray]:
    """Vertices (K, 3) of the convex hulls of some parts; a hull that lies inside of another one's is left out.

    Together they hold what all of the parts' hulls hold. Of a part that is flat the hull is its bounding box.

    Parameters
    ----------
    parts_m : (N, 3) points of each.
    """
    hulls = [_hull(points) for points in parts_m]
    lows, highs = (np.array([f(points, axis=0) for points, _ in hulls]) for f in (np.min, np.max))
    kept: list[int] = []
    # the largest first: of two that are the same one is kept
    for k in np.argsort(-np.prod(highs - lows, axis=1), kind="stable").tolist():
        about = [n for n in kept if np.all(lows[n] <= lows[k]) and np.all(highs[n] >= highs[k])]
        if not any(_inside(hulls[k][0], hulls[n][1], highs[n] - lows[n]) for n in about):
            kept.append(k)
    return [hulls[k][0] for k in sorted(kept)]


def _inside(points_m: FloatArray, planes: FloatArray, extent_m: FloatArray) -> bool:
    beyond = points_m @ planes[:, :3].T + planes[:, 3]
    return bool(beyond.max() <= _ROUNDING * extent_m.max())


def _hull(points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vertices (K, 3) of the convex hull, or of the bounding box where the points are flat, and its planes (F, 4)."""
    try:
        hull = ConvexHull(points_m)
    except QhullError:
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        planes = np.column_stack([np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([-high, low])])
        return np.asarray(low + corners * (high - low)), planes
    return np.asarray(points_m[hull.vertices]), np.asarray(hull.equations)
