"""Clearance between camera and mesh, and the share of a pose inside the image."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.triangles import distance_to_triangles, encloses_origin
from flyaround.simulator.recipes.poses import radius_m
from flyaround.simulator.targets.joined_mesh import box_3d_m

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose


def is_clear(pose: Pose, target: Target, clearance_m: float) -> bool:
    """Return True if the camera is outside the mesh by more than the clearance."""
    camera_m = pose.R.T @ -np.asarray(pose.t_m, float)
    if np.linalg.norm(camera_m) - radius_m(target) > clearance_m:
        return True
    corners = _corners(target) - camera_m
    from_corner = np.linalg.norm(corners[:, 0], axis=1)
    if from_corner.min() <= clearance_m:
        return False
    # lower bound of a triangle's distance: that of its first corner minus its longer side there
    near = corners[from_corner - _reach_m(target) <= clearance_m]
    if len(near) and distance_to_triangles(np.zeros((len(near), 3)), near).min() <= clearance_m:
        return False
    low, high = box_3d_m(target)[0], box_3d_m(target)[-1]
    return bool(np.any((camera_m < low) | (camera_m > high))) or not encloses_origin(corners)


def share_inside(pose: Pose, target: Target, camera: Camera) -> float:
    """Return the share of the bounding box of the projected mesh inside the image; 0 if part is behind the camera."""
    points = pose.apply(box_3d_m(target))
    if points[:, 2].min() <= 0:
        return 0.0
    pixels = camera.project(pose.apply(_corners(target).reshape(-1, 3)))
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    if not np.all(np.isfinite([low, high])):
        return 0.0
    size = np.array([camera.width_px, camera.height_px])
    inside = np.clip(np.minimum(high, size - 0.5) - np.maximum(low, -0.5), 0, None)
    return float(np.prod(inside / np.maximum(high - low, 1e-9)))


@lru_cache(maxsize=4)
def _corners(target: Target) -> FloatArray:
    """Return the (T, 3, 3) corners of every triangle, target frame."""
    return np.concatenate([p.positions_m.astype(float)[p.triangles] for p in target.parts])


@lru_cache(maxsize=4)
def _reach_m(target: Target) -> FloatArray:
    """Return (T,) the longer side at the first corner of every triangle."""
    corners = _corners(target)
    return np.asarray(np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max(axis=1))
