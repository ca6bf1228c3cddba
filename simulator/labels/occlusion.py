"""Exact visibility of points on the mesh: which triangle comes first along a ray, by projection.

All rays of one query share a centre (the camera) or a direction (the Sun), so the mesh is projected once
and each point is compared with the few triangles whose projection covers it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from simulator.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.targets.model import Target

# A keypoint lies on the surface to well below this, and no two parts of a craft are closer on purpose.
SURFACE_TOLERANCE_M = 2e-3


@dataclass(frozen=True, eq=False)
class Mesh:
    """All triangles of a target: positions (N, 3) [m] and indices (M, 3)."""

    positions_m: FloatArray
    triangles: IntArray

    @staticmethod
    def of(target: Target) -> Mesh:
        """The parts of a target joined."""
        offsets = np.cumsum([0] + [len(p.positions_m) for p in target.parts[:-1]])
        return Mesh(
            np.concatenate([p.positions_m for p in target.parts]).astype(np.float64),
            np.concatenate([p.triangles + o for p, o in zip(target.parts, offsets, strict=True)]).astype(
                np.int64
            ),
        )


@lru_cache(maxsize=64)
def mesh_of(target: Target) -> Mesh:
    """``Mesh.of``, kept for the targets in use."""
    return Mesh.of(target)


def triangle_bounds(xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest x, y (2, M) of projected triangles (M, 3, 2).

    Columns apart: numpy reduces and compares contiguous rows several times faster than pairs.
    """
    low, high = np.empty((2, 2, len(xy)))
    for axis in range(2):
        a, b, c = (np.ascontiguousarray(xy[:, k, axis]) for k in range(3))
        np.minimum(np.minimum(a, b), c, out=low[axis])
        np.maximum(np.maximum(a, b), c, out=high[axis])
    return low, high


def _covered(
    xy: FloatArray, key: FloatArray, point_xy: FloatArray, point_key: FloatArray, *, nearer_is_larger: bool
) -> BoolArray:
    """Whether some triangle covers each point with a strictly nearer key.

    Parameters
    ----------
    xy : (M, 3, 2) projected corners. key : (M, 3) a quantity linear over the projected triangle.
    point_xy : (K, 2). point_key : (K,) the key that a triangle must beat.
    nearer_is_larger : True for inverse depth, False for depth.
    """
    low, high = triangle_bounds(xy)
    hit = np.zeros(len(point_xy), bool)
    for k, p in enumerate(point_xy):
        near = np.flatnonzero((low[0] <= p[0]) & (high[0] >= p[0]) & (low[1] <= p[1]) & (high[1] >= p[1]))
        if near.size == 0:
            continue
        a, b, c = (xy[near, i] for i in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((b[:, 0] - p[0]) * (c[:, 1] - p[1]) - (b[:, 1] - p[1]) * (c[:, 0] - p[0])) / area
            v = ((c[:, 0] - p[0]) * (a[:, 1] - p[1]) - (c[:, 1] - p[1]) * (a[:, 0] - p[0])) / area
            w = 1 - u - v
            value = u * key[near, 0] + v * key[near, 1] + w * key[near, 2]
            beats = value > point_key[k] if nearer_is_larger else value < point_key[k]
            hit[k] = bool(np.any((u >= 0) & (v >= 0) & (w >= 0) & beats))
    return hit


def occluded_from_camera(
    mesh: Mesh, points_m: ArrayLike, R_camera_from_target: FloatArray, t_camera_from_target_m: ArrayLike
) -> BoolArray:
    """Whether the mesh hides each point from a pinhole at the camera's origin.

    Parameters
    ----------
    points_m : (K, 3) points on the surface, target frame [m].
    """
    t = np.asarray(t_camera_from_target_m, float)
    vertices = mesh.positions_m @ R_camera_from_target.T + t
    points = np.asarray(points_m, float) @ R_camera_from_target.T + t
    triangles = mesh.triangles
    if vertices[:, 2].min() <= 1e-3:
        triangles = triangles[np.all(vertices[triangles, 2] > 1e-3, axis=1)]
    xy = (vertices[:, :2] / vertices[:, 2:])[triangles]
    distance = np.linalg.norm(points, axis=1)
    shrink = 1 - SURFACE_TOLERANCE_M / np.maximum(distance, 1e-9)
    # 1/z is linear over the projected triangle; a hider lies nearer along the ray by the tolerance
    key = 1 / (points[:, 2] * shrink)
    return _covered(
        xy, (1 / vertices[:, 2])[triangles], points[:, :2] / points[:, 2:], key, nearer_is_larger=True
    )


def hidden_from_direction(mesh: Mesh, points_m: ArrayLike, direction: ArrayLike) -> BoolArray:
    """Whether the mesh stands between each point and a source at infinity (the Sun).

    Parameters
    ----------
    points_m : (K, 3) points on the surface, target frame [m].
    direction : (3,) unit vector towards the source, target frame.
    """
    d = np.asarray(direction, float)
    helper = np.eye(3)[int(np.argmin(np.abs(d)))]
    e1 = np.cross(d, helper)
    e1 /= np.linalg.norm(e1)
    basis = np.stack([e1, np.cross(d, e1), -d])  # third row: distance from the source, up to a constant
    corners = (mesh.positions_m @ basis.T)[mesh.triangles]
    points = np.asarray(points_m, float) @ basis.T
    return _covered(
        corners[..., :2],
        corners[..., 2],
        points[:, :2],
        points[:, 2] - SURFACE_TOLERANCE_M,
        nearer_is_larger=False,
    )
