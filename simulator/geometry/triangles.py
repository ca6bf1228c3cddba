"""Geometry of triangles: distances of points, closed surfaces, directions spread evenly over the sphere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray


def sphere_directions(count: int) -> FloatArray:
    """(count, 3) unit vectors, nearly even: the Fibonacci lattice (Gonzalez 2010, Mathematical Geosciences 42)."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = np.pi * (1 + np.sqrt(5.0)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)


def distance_to_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(N,) distance of point k (N, 3) to triangle k (N, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    best = np.full(len(points), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        length2 = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
        s = np.clip(np.einsum("ij,ij->i", points - p, edge) / length2, 0, 1)
        best = np.minimum(best, np.linalg.norm(points - p - s[:, None] * edge, axis=1))
    n = np.cross(b - a, c - a)
    inside = np.ones(len(points), bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(q - p, points - p), n) >= 0
    height = np.abs(np.einsum("ij,ij->i", points - a, n)) / np.maximum(np.linalg.norm(n, axis=1), 1e-300)
    return np.where(inside, height, best)


def is_closed(positions_m: NDArray[np.floating], triangles: IntArray) -> bool:
    """Return True if every edge is met once in each direction, and the signed volume is positive."""
    # corners that share a place are one, whatever their normals
    _, place = np.unique(np.round(positions_m, 6), axis=0, return_inverse=True)
    corners = place.ravel()[np.asarray(triangles)]
    start = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    count = len(place)
    forward, backward = start * count + end, end * count + start
    real = start != end  # slivers may have lost an edge in the rounding
    p = positions_m.astype(float)[np.asarray(triangles)]
    volume = np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2]))
    return bool(volume > 0 and np.array_equal(np.sort(forward[real]), np.sort(backward[real])))
