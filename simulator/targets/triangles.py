"""Distances of points to triangles."""

from __future__ import annotations

import numpy as np

from simulator.runtime.arrays import FloatArray


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
