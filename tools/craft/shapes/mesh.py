"""A triangle mesh under construction: float64 vertices with normals, and how meshes are joined and moved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])  # cyclic permutations of three coordinates


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a normal per vertex; vertices are split where the surface has a crease.

    Parameters
    ----------
    positions_m : (N, 3) array
        .
    normals : (N, 3) array
        Outward unit normals.
    triangles : IntArray
        (M, 3) indices, counter-clockwise seen from outside.
    """

    positions_m: FloatArray
    normals: FloatArray
    triangles: IntArray

    def moved(self, offset_m: ArrayLike) -> Mesh:
        """Return the mesh translated by ``offset_m`` (3,)."""
        return Mesh(self.positions_m + np.asarray(offset_m, float), self.normals, self.triangles)

    def rotated(self, R: ArrayLike) -> Mesh:
        """Return the mesh rotated by the (3, 3) rotation ``R`` about the origin."""
        rotation = np.asarray(R, float)
        return Mesh(self.positions_m @ rotation.T, self.normals @ rotation.T, self.triangles)

    def mirrored(self, axis: int) -> Mesh:
        """Return the mesh reflected in the plane through the origin across ``axis`` (0, 1 or 2)."""
        sign = np.ones(3)
        sign[axis] = -1.0
        # a reflection turns the winding round
        return Mesh(self.positions_m * sign, self.normals * sign, self.triangles[:, ::-1])


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh with the triangles of all; nothing is welded."""
    offsets = np.cumsum([0] + [len(m.positions_m) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.positions_m for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.triangles + k for m, k in zip(meshes, offsets, strict=True)]),
    )


def unit(v: ArrayLike) -> FloatArray:
    """Return the unit vector along ``v`` (..., 3)."""
    a = np.asarray(v, float)
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def cross(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the cross product of vectors (..., 3), like `numpy.cross` but several times faster for a few."""
    first, second = np.asarray(a, float), np.asarray(b, float)
    forth = np.take(first, _NEXT, axis=-1) * np.take(second, _AFTER, axis=-1)
    return np.asarray(forth - np.take(first, _AFTER, axis=-1) * np.take(second, _NEXT, axis=-1))


def following(points: FloatArray) -> FloatArray:
    """Return the points (K, ...) of a closed line from the second to the first, like `numpy.roll` by -1 but much
    faster.
    """
    return np.concatenate([points[1:], points[:1]])


def preceding(points: FloatArray) -> FloatArray:
    """Return the points (K, ...) of a closed line, from the last to the one before it."""
    return np.concatenate([points[-1:], points[:-1]])


def flat_faces(faces: Sequence[ArrayLike]) -> Mesh:
    """Return convex planar polygons (K, 3), counter-clockwise from outside, each with its own flat normal."""
    positions, normals, triangles = [], [], []
    start = 0
    for face in faces:
        p = np.asarray(face, float)
        # Newell's formula: the area vector of a polygon
        n = unit(cross(p - p[0], following(p) - p[0]).sum(axis=0))
        positions.append(p)
        normals.append(np.tile(n, (len(p), 1)))
        triangles += [(start, start + k, start + k + 1) for k in range(1, len(p) - 1)]
        start += len(p)
    return Mesh(np.concatenate(positions), np.concatenate(normals), np.asarray(triangles, np.int64))


def convex_solid(faces: Sequence[ArrayLike]) -> Mesh:
    """Return a convex body of flat faces (K, 3) in any winding; each is turned to face away from the centroid."""
    polygons = [np.asarray(f, float) for f in faces]
    centre = np.concatenate(polygons).mean(axis=0)
    turned = []
    for p in polygons:
        n = cross(p - p[0], following(p) - p[0]).sum(axis=0)
        turned.append(p if n @ (p.mean(axis=0) - centre) > 0 else p[::-1])
    return flat_faces(turned)
