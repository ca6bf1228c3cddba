"""Motion in the image during an exposure: of the craft's bounding box, and of a grid on ground and sky."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.motion import central_velocity_m_s, propagated_scene
from flyaround.simulator.targets.joined_mesh import box_3d_m
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MAX_SMEAR_PX, MAX_RESIDUAL_PX = 2.5, 0.5
"""Largest displacement of a craft that is drawn once and smeared, and largest residual of the affine flow [px]. The
ends of a smear are then correct within a quarter of a pixel.
"""

MAX_GROUND_SPEED_M_S = 1.6e3
"""Bound on ground speed from rotation [m s-1]: the Earth's equator moves at 465, that of Mars at 240."""


@dataclass(frozen=True, eq=False)
class CraftFlow:
    """Optical flow of a craft as an affine function, fitted to the displacements of its bounding box's corners.

    Parameters
    ----------
    affine : (3, 2) array
        Displacement at the image's origin, and its derivatives along x and y [px, 1].
    longest_px : float
        Largest displacement of a corner.
    residual_px : float
        Largest residual of the corners' displacements.
    """

    affine: FloatArray
    longest_px: float
    residual_px: float

    def displacements_px(self, pixels: FloatArray) -> FloatArray:
        """Return (K, 2) displacements at (K, 2) pixels [px]."""
        return np.asarray(self.affine[0] + pixels @ self.affine[1:])

    @property
    def n_drawings(self) -> int:
        """Number of drawings of the craft, each of which is smeared."""
        return max(
            math.ceil(self.longest_px / MAX_SMEAR_PX), math.ceil(self.residual_px / MAX_RESIDUAL_PX), 1
        )


def craft_flow(mid: SceneState, early: SceneState, late: SceneState, target: Target) -> CraftFlow:
    """Return the flow of a craft from ``early`` to ``late`` at its position in ``mid``; zero behind the camera."""
    points, start, end = (target_corners_px(mid, moment, target) for moment in (mid, early, late))
    design = np.column_stack([np.ones(len(points)), np.nan_to_num(points)])
    displacements = np.nan_to_num(end - start)
    affine = np.asarray(np.linalg.lstsq(design, displacements, rcond=None)[0], float)
    return CraftFlow(
        affine, float(np.hypot(*displacements.T).max()), float(np.abs(design @ affine - displacements).max())
    )


def scene_propagator(scene: SceneState) -> Callable[[float], SceneState]:
    """Return `propagated_scene` of one scene, cached by time."""
    return cache(partial(propagated_scene, scene))


def image_motion_px(
    scene: SceneState, target: Target, span_s: float, scene_at: Callable[[float], SceneState] | None = None
) -> float:
    """Return the largest displacement of anything in the image during ``span_s`` about mid-exposure [px].

    The corners of the craft's bounding box are tracked, and a grid of directions: the ground where one meets the Earth,
    else the sky.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    span_s : float
        Duration of the motion [s].
    scene_at : callable, optional
        Result of `scene_propagator` for the scene.
    """
    if span_s == 0:
        return 0.0
    scene_at = scene_at or scene_propagator(scene)
    early, late = (_tracked_px(scene, scene_at(sign * span_s / 2), target) for sign in (-1, 1))
    displacement = np.hypot(*(late - early).T)
    return float(np.nanmax(displacement, initial=0.0))


def motion_bound_px(scene: SceneState, target: Target, span_s: float) -> float:
    """Return an upper bound of `image_motion_px`, at a fraction of its cost; infinite if unknown."""
    camera, size = scene.camera, float(np.linalg.norm(box_3d_m(target), axis=1).max())
    t = scene.t_camera_from_target_m
    central, body = scene.central, scene.central.body
    height = math.dist(scene.r_camera_eci_m, central.r_eci_m) - body.radius_m
    # within two sizes or a kilometre, rates change too much during the exposure for this bound
    if not camera.distortion.is_none or t[2] <= 2 * size or height <= 1e3:
        return float("inf")
    relative_speed = math.dist(scene.v_target_eci_m_s, scene.v_camera_eci_m_s)
    camera_rate, target_rate = math.hypot(*scene.omega_camera_rad_s), math.hypot(*scene.omega_target_rad_s)
    craft_px = (relative_speed + size * target_rate) / (t[2] - size)
    relative = np.subtract(scene.v_camera_eci_m_s, central_velocity_m_s(scene))
    ground = (math.hypot(*relative) + MAX_GROUND_SPEED_M_S) / height
    # image scale grows with the square of the distance from the axis
    x = max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px
    y = max(camera.cy_px, camera.height_px - camera.cy_px) / camera.fy_px
    off_axis = max(math.hypot(x, y), (math.hypot(t[0], t[1]) + size) / (t[2] - size))
    rate = camera_rate + max(craft_px, ground if scene.environment.draws(body) else 0.0)
    # margin of a quarter, which exceeds the change of the rates within the span
    return 1.25 * span_s * rate * max(camera.fx_px, camera.fy_px) * (1 + off_axis**2)


def _tracked_px(scene: SceneState, later_scene: SceneState, target: Target) -> FloatArray:
    """Return (K, 2) pixels in ``later_scene`` of the tracked points of ``scene``; NaN behind the camera."""
    c = scene.camera
    u, v = np.meshgrid(np.linspace(0, c.width_px - 1, 5), np.linspace(0, c.height_px - 1, 5))
    behind = background_px(scene, later_scene, np.stack([u.ravel(), v.ravel()], axis=1))
    return np.concatenate([target_corners_px(scene, later_scene, target), behind])


def background_px(scene: SceneState, later_scene: SceneState, pixels: FloatArray) -> FloatArray:
    """Return (K, 2) positions in ``later_scene`` of the ground or sky at pixels of ``scene``."""
    d = scene.camera.rays(pixels)
    d = d @ matrix_from_quat(scene.q_camera_from_eci_wxyz)  # in ECI
    body, states = scene.central.body, (scene.central, later_scene.central)
    R_now, R_then = (s.R_fixed_from_eci.T if body.turns else np.eye(3) for s in states)
    centers = [np.asarray(s.r_eci_m) for s in states]
    r = np.asarray(scene.r_camera_eci_m) - centers[0]
    along = -d @ r
    discriminant = along**2 - (r @ r - body.radius_m**2)
    ground = (discriminant > 0) & (along > 0) & scene.environment.draws(body)
    positions = r + (along - np.sqrt(np.maximum(discriminant, 0)))[:, None] * d
    positions = positions @ (R_then @ R_now.T).T + centers[1] - np.asarray(later_scene.r_camera_eci_m)
    in_camera = (
        np.where(ground[:, None], positions, d) @ matrix_from_quat(later_scene.q_camera_from_eci_wxyz).T
    )
    return np.asarray(later_scene.camera.project(in_camera))


def target_corners_px(scene: SceneState, later_scene: SceneState, target: Target) -> FloatArray:
    """Return (8, 2) corners of the craft's box in ``later_scene``; zeros if they are not in the image."""
    corners, c = box_3d_m(target), scene.camera
    moved_px = later_scene.camera.project(later_scene.camera_from_target.apply(corners))
    corners_px = scene.camera.project(scene.camera_from_target.apply(corners))
    # a craft far outside the image needs no smear
    size = np.array([c.width_px, c.height_px])
    if (
        not np.all(np.isfinite(corners_px))
        or np.any(corners_px.max(axis=0) < 0)
        or np.any(corners_px.min(axis=0) > size)
    ):
        moved_px = np.zeros_like(moved_px)
    return np.asarray(moved_px)
