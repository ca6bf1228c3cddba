"""Triangles: normals, planes, distances of points, and whether they enclose a point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import FloatArray


def face_vectors(corners: NDArray[np.floating]) -> FloatArray:
    """Return the normals of triangles (T, 3, 3), as long as twice their areas.

    Returns
    -------
    (T, 3) array
        Normals in the order of the triangles, on the side from which the corners run anticlockwise.
    """
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def face_planes(corners: FloatArray) -> FloatArray:
    """Return the planes of triangles (T, 3, 3).

    Returns
    -------
    (T, 4) array
        Unit normal, and negated distance of the plane from the origin along it; four zeros for a triangle without area.
    """
    normal = face_vectors(corners)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    return np.column_stack([normal, -np.einsum("ij,ij->i", normal, corners[:, 0])])


def distance_to_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the distance of each point (N, 3) from its triangle (N, 3, 3).

    Returns
    -------
    (N,) array
        Distance [m]; for a sliver, from its sides.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    best = np.full(len(points), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        length2 = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
        s = np.clip(np.einsum("ij,ij->i", points - p, edge) / length2, 0, 1)
        best = np.minimum(best, np.linalg.norm(points - p - s[:, None] * edge, axis=1))
    n = np.cross(b - a, c - a)
    twice_area = np.linalg.norm(n, axis=1)
    inside = twice_area > 1e-15
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(q - p, points - p), n) >= 0
    height = np.abs(np.einsum("ij,ij->i", points - a, n)) / np.maximum(twice_area, 1e-300)
    return np.where(inside, height, best)


def encloses_origin(corners: FloatArray) -> bool:
    """Return True if the closed shells of triangles (T, 3, 3) enclose the origin, by their solid angle.

    Returns
    -------
    bool
        True if the shells' solid angle at the origin exceeds 2 pi in size, whichever way they face.

    References
    ----------
    Van Oosterom and Strackee (1983), The solid angle of a plane triangle, eq. 8.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    solid = 2 * np.arctan2((a * np.cross(b, c)).sum(axis=1), below)
    return bool(abs(solid.sum()) > 2 * np.pi)
