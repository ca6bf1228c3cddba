"""What a ray from the camera meets first, by intersecting it with the mesh on the CPU in double precision."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.check.raster_tolerance import triangles_near
from flyaround.simulator.geometry.triangle_fill import lowest_and_highest
from flyaround.simulator.runtime.memory import cached_per_object
from flyaround.simulator.targets.joined_mesh import mesh_of

if TYPE_CHECKING:
    from flyaround.simulator.dataset.check.raster_tolerance import ShowableTriangles
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

NEAR_M = 1e-3
FLAT = 1e-14  # twice the area of a triangle seen edge-on, in the plane z = 1


@dataclass(frozen=True, eq=False)
class Hits:
    """Everything along one ray, nearest first: camera z [m], part (from 1), unit normals (N, 3) camera frame."""

    z_m: FloatArray
    parts: IntArray
    normals: FloatArray


@cached_per_object
def _part_of_triangle(target: Target) -> IntArray:
    return np.repeat(np.arange(1, len(target.parts) + 1), [len(part.triangles) for part in target.parts])


@cached_per_object
def _normals(target: Target) -> FloatArray:
    return np.concatenate([part.normals for part in target.parts]).astype(float)


class RayCaster:
    """A target at a pose, ready to be asked along many rays."""

    def __init__(self, target: Target, camera_from_target: Pose) -> None:
        mesh = mesh_of(target)
        vertices = camera_from_target.apply(mesh.positions_m)
        triangles, self._parts = mesh.triangles, _part_of_triangle(target)
        self._normals, self._R = _normals(target), camera_from_target.R
        n_ahead = (vertices[triangles, 2] > NEAR_M).sum(axis=1)
        self._triangles, parts = triangles[n_ahead == 3], self._parts[n_ahead == 3]
        cut = np.flatnonzero((n_ahead > 0) & (n_ahead < 3))
        if len(cut):
            pieces = [_ahead_of_camera(vertices, self._normals, triangles[k]) for k in cut]
            sizes = np.array([len(points) for points, _ in pieces])
            first = len(vertices) + np.concatenate([[0], np.cumsum(sizes)[:-1]])
            # a triangle or a quadrilateral of each, as a fan from its first corner
            fans = [(i, i + k, i + k + 1) for i, m in zip(first, sizes, strict=True) for k in range(1, m - 1)]
            vertices = np.concatenate([vertices, *(points for points, _ in pieces)])
            self._normals = np.concatenate([self._normals, *(normals for _, normals in pieces)])
            self._triangles = np.concatenate([self._triangles, np.array(fans)])
            parts = np.concatenate([parts, np.repeat(self._parts[cut], sizes - 2)])
        self._parts = parts
        corners = vertices[self._triangles]
        self._xy = corners[..., :2] / corners[..., 2:]
        self._inverse = 1 / corners[..., 2]
        low, high = lowest_and_highest(self._xy)
        self._low, self._high = np.ascontiguousarray(low.T), np.ascontiguousarray(high.T)

    def largest_triangles(self) -> FloatArray:
        """(K, 2) x/z, y/z of the middles of the three triangles of each part that look largest."""
        e1, e2 = self._xy[:, 1] - self._xy[:, 0], self._xy[:, 2] - self._xy[:, 0]
        order = np.lexsort((-np.abs(_cross(e1, e2)), self._parts))
        _, first, count = np.unique(self._parts[order], return_index=True, return_counts=True)
        rank = np.arange(len(order)) - np.repeat(first, count)
        return np.asarray(self._xy[order[rank < 3]].mean(axis=1))

    def triangles_near(self, ray: FloatArray, px_per_ray: FloatArray, doubt_px: float) -> ShowableTriangles:
        """Triangles that a raster may show at the pixel of the ray through (x, y, 1), camera frame.

        Parameters
        ----------
        px_per_ray : (2, 2) how a step of the ray moves the pixel. doubt_px : how far from its centre they may be.
        """
        reach = doubt_px * np.abs(np.linalg.inv(px_per_ray)).sum(axis=1)
        low, high = self._low, self._high
        near = np.flatnonzero(
            (low[0] <= ray[0] + reach[0])
            & (high[0] >= ray[0] - reach[0])
            & (low[1] <= ray[1] + reach[1])
            & (high[1] >= ray[1] - reach[1])
        )
        return triangles_near(
            (self._xy[near] - ray[:2]) @ px_per_ray.T,
            self._inverse[near],
            self._normals[self._triangles[near]] @ self._R.T,
            self._parts[near],
            doubt_px,
        )

    def hits(self, ray: FloatArray) -> Hits:
        """What lies along the ray through (x, y, 1), camera frame."""
        low, high = self._low, self._high
        near = np.flatnonzero(
            (low[0] <= ray[0]) & (high[0] >= ray[0]) & (low[1] <= ray[1]) & (high[1] >= ray[1])
        )
        a, b, c = (self._xy[near, k] - ray[:2] for k in range(3))
        weights = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
        area = weights.sum(axis=1)
        inside = (np.abs(area) > FLAT) & (np.all(weights >= 0, axis=1) | np.all(weights <= 0, axis=1))
        near, weights = near[inside], weights[inside] / area[inside, None]
        # shares on the screen; over depth they are the shares on the triangle
        inverse = (weights * self._inverse[near]).sum(axis=1)
        on_triangle = weights * self._inverse[near] / inverse[:, None]
        normals = (on_triangle[..., None] * self._normals[self._triangles[near]]).sum(axis=1) @ self._R.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        order = np.argsort(-inverse)
        return Hits(1 / inverse[order], self._parts[near][order], normals[order])


def _ahead_of_camera(
    vertices: FloatArray, normals: FloatArray, triangle: IntArray
) -> tuple[FloatArray, FloatArray]:
    """What of a triangle is ahead of the camera: corners (3 or 4, 3) in order, and their normals."""
    points, along = [], []
    for a, b in zip(triangle, np.roll(triangle, -1), strict=True):
        za, zb = vertices[a, 2], vertices[b, 2]
        if za > NEAR_M:
            points.append(vertices[a])
            along.append(normals[a])
        if (za > NEAR_M) != (zb > NEAR_M):
            share = (NEAR_M - za) / (zb - za)
            points.append(vertices[a] + share * (vertices[b] - vertices[a]))
            along.append(normals[a] + share * (normals[b] - normals[a]))
    return np.array(points), np.array(along)


@lru_cache(maxsize=2)
def ray_caster(target: Target, camera_from_target: Pose) -> RayCaster:
    """A target at a pose, kept for the next check of the same frame."""
    return RayCaster(target, camera_from_target)


def _cross(p: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
