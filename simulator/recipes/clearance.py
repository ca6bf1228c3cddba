"""How near the camera is to a mesh, and how much of a pose the image holds."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.recipes.poses import radius_m

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose


def is_clear(pose: Pose, target: Target, clearance_m: float) -> bool:
    """Whether the camera is outside of the mesh and farther from it than that."""
    camera_m = pose.R.T @ -np.asarray(pose.t_m, float)
    if np.linalg.norm(camera_m) - radius_m(target) > clearance_m:
        return True
    corners = _corners(target) - camera_m
    from_corner = np.linalg.norm(corners[:, 0], axis=1)
    if from_corner.min() <= clearance_m:
        return False
    # a triangle reaches no nearer than its first corner less its longer side from there
    near = corners[from_corner - _reach_m(target) <= clearance_m]
    if len(near) and _distances_m(near).min() <= clearance_m:
        return False
    low, high = _box(target)[0], _box(target)[-1]
    return bool(np.any((camera_m < low) | (camera_m > high))) or not _encloses_origin(corners)


def share_inside(pose: Pose, target: Target, camera: Camera) -> float:
    """Share of the box about the projected mesh that the image holds; 0 where the mesh reaches behind the camera."""
    points = pose.apply(_box(target))
    if points[:, 2].min() <= 0:
        return 0.0
    pixels = camera.project(pose.apply(_corners(target).reshape(-1, 3)))
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    if not np.all(np.isfinite([low, high])):
        return 0.0
    size = np.array([camera.width_px, camera.height_px])
    held = np.clip(np.minimum(high, size - 0.5) - np.maximum(low, -0.5), 0, None)
    return float(np.prod(held / np.maximum(high - low, 1e-9)))


@lru_cache(maxsize=4)
def _corners(target: Target) -> FloatArray:
    """(T, 3, 3) corners of every triangle, target frame."""
    return np.concatenate([p.positions_m.astype(float)[p.triangles] for p in target.parts])


@lru_cache(maxsize=4)
def _reach_m(target: Target) -> FloatArray:
    """(T,) of every triangle: the longer side at its first corner."""
    corners = _corners(target)
    return np.asarray(np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max(axis=1))


@lru_cache(maxsize=4)
def _box(target: Target) -> FloatArray:
    """(8, 3) corners of the box about the mesh."""
    points = _corners(target).reshape(-1, 3)
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    return np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3)


def _distances_m(corners: FloatArray) -> FloatArray:
    """(T,) distance of the origin from triangles (T, 3, 3): from the face where it stands over it, else from a side."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", normal, a)) / np.maximum(length, 1e-30)
    # over the face: the origin is on the same side of all three
    over = length > 1e-15
    for p, q in ((a, b), (b, c), (c, a)):
        over &= np.einsum("ij,ij->i", np.cross(q - p, -p), normal) >= 0
    sides = np.min([_from_side_m(p, q) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.where(over, height, sides)


def _from_side_m(p: FloatArray, q: FloatArray) -> FloatArray:
    """(T,) distance of the origin from segments."""
    along = q - p
    share = np.clip(-np.einsum("ij,ij->i", p, along) / np.maximum((along**2).sum(axis=1), 1e-30), 0, 1)
    return np.asarray(np.linalg.norm(p + share[:, None] * along, axis=1))


def _encloses_origin(corners: FloatArray) -> bool:
    """Whether closed shells hold the origin: the solid angle of all triangles (Van Oosterom and Strackee 1983)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    solid = 2 * np.arctan2((a * np.cross(b, c)).sum(axis=1), below)
    return bool(abs(solid.sum()) > 2 * np.pi)
