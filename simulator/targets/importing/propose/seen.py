"""Which points of a mesh can be seen from outside: small depth pictures from 26 directions, drawn on the CPU."""

from __future__ import annotations

import itertools

import cv2
import numpy as np

from simulator.runtime.arrays import FloatArray, IntArray
from simulator.targets.builders.mesh import across
from simulator.targets.importing.repair.decimate import decimate
from simulator.targets.importing.repair.topology import Body

SIZE_PX = 384
MOST_TRIANGLES = 15_000
TOLERANCE = 0.012
"""As a share of the craft: what a coarse mesh and a coarse picture may be wrong by."""
DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def times_seen(bodies: list[Body], points_m: FloatArray) -> IntArray:
    """(K,) from how many of 26 directions each point (K, 3) is not hidden by the bodies."""
    if sum(len(b.triangles) for b in bodies) > MOST_TRIANGLES:
        bodies = decimate(bodies, MOST_TRIANGLES)
    corners = np.concatenate([b.positions_m[b.triangles] for b in bodies])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    radius = float(np.linalg.norm(high - low)) / 2
    centre = (low + high) / 2
    count = np.zeros(len(points_m), np.int64)
    for direction in DIRECTIONS:
        u, v, w = across(direction)
        basis = np.stack([u, v, -w])  # third: distance from a camera at infinity, up to a constant
        depth_picture = _depth_picture((corners - centre) @ basis.T, radius)
        at = (points_m - centre) @ basis.T
        column, row = np.clip(_pixels(at[:, :2], radius), 0, SIZE_PX - 1).T
        count += at[:, 2] <= depth_picture[row, column] + TOLERANCE * 2 * radius
    return count


def _pixels(xy: FloatArray, radius: float) -> IntArray:
    return np.rint((xy / radius * 0.98 + 1) * (SIZE_PX - 1) / 2).astype(np.int64)


def _depth_picture(corners: FloatArray, radius: float) -> FloatArray:
    """Distance of the nearest face at each pixel, the farther of its 3 x 3 neighbours; background infinite."""
    depth = corners[..., 2].mean(axis=1)
    flat = _pixels(corners[..., :2].reshape(-1, 2), radius).reshape(-1, 3, 2).astype(np.int32)
    picture = np.full((SIZE_PX, SIZE_PX), 1e9, np.float32)
    # painter's order: the nearest last
    for k in np.argsort(-depth, kind="stable"):
        cv2.fillConvexPoly(picture, flat[k], float(depth[k]))
    # an edge lies between its own face and what is behind it
    return np.asarray(cv2.dilate(picture, np.ones((3, 3), np.uint8)), float)
