"""Random poses of a calibration board: spread over the image, tilted, and entirely visible."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix, quat_from_rotvec

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target

_CANDIDATES = 80  # candidate directions for each pose
_DISTANCE_STEPS, _DISTANCE_RATIO = 12, 1.15  # number of distances to try, and the ratio of successive ones
# Tilts as a share of the largest: small ones do not separate the focal length from the distance (Zhang 2000).
_TILT_SHARES = (0.3, 1.0)
_MAX_ROLL_DEG = 20.0  # as boards are held by hand
_SPAN_SHARES = (
    0.55,
    0.8,
)  # of the image: a smaller board has coarse corners, a larger one always has the same place
# Distances among which the first is found, in widths of the board: from beyond a fish-eye's to beyond a long lens's.
_DISTANCES = np.geomspace(0.3, 60.0, 100)
MARGIN_PX = 6.0  # minimum distance of the board from the image's edge


def board_pose(
    rng: Generator, camera: Camera, target: Target, k: int, facing_deg: float
) -> tuple[FloatArray, FloatArray]:
    """Draw the pose of a board: its position cycles through a 3 x 3 grid of image cells, tilt and roll are random.

    Parameters
    ----------
    rng : Generator
        Random generator.
    camera : Camera
        Camera to calibrate.
    target : Target
        Flat target.
    k : int
        Number of the pose, which selects the cell.
    facing_deg : float
        Largest tilt out of the plane perpendicular to the line of sight.

    Returns
    -------
    tuple of array
        q_camera_from_target_wxyz (4,), t_camera_from_target_m (3,).

    Raises
    ------
    UserError
        If no pose fits the image.
    """
    points = np.concatenate([p.positions_m for p in target.parts]).astype(float)
    low, high = points.min(axis=0), points.max(axis=0)
    # include the midpoints of the sides, because a fish-eye lens projects the sides as outward curves
    across, up = ((a, (a + b) / 2, b) for a, b in zip(low[:2], high[:2], strict=True))
    rim = np.array([[x, y, high[2]] for x in across for y in up])
    size = np.array([camera.width_px, camera.height_px])
    # facing the camera: the board's z axis points at the camera, its y axis up in the image
    facing = np.diag([1.0, -1.0, -1.0])
    towards_cell = np.array([k % 3, k // 3 % 3]) - 1.0
    axis_turn, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(*_TILT_SHARES) * facing_deg)
    roll = np.radians(rng.uniform(-_MAX_ROLL_DEG, _MAX_ROLL_DEG))
    tilt_rotation = _rotation(tilt * np.array([np.cos(axis_turn), np.sin(axis_turn), 0.0]))
    orientation = tilt_rotation @ _rotation(np.array([0.0, 0.0, roll])) @ facing
    share = rng.uniform(*_SPAN_SHARES)
    near = _distance_for_span(camera, rim @ orientation.T, share * size)
    rays = camera.rays(rng.uniform(0, 1, (_CANDIDATES, 2)) * (size - 1))
    # a board near the corner of a wide-angle image may not fit: if so, move it farther away
    for step in range(_DISTANCE_STEPS):
        fit = _farthest_place(camera, rim @ orientation.T, near * _DISTANCE_RATIO**step, rays, towards_cell)
        if fit is not None:
            R, t = fit
            return quat_from_matrix(R @ orientation), t
    raise UserError(
        f"no pose of {target.name} fits the image of {camera.width_px} x {camera.height_px} pixels: "
        "give a camera with more of them"
    )


def _farthest_place(
    camera: Camera, rim_m: FloatArray, distance_m: float, rays: FloatArray, towards_cell: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return the rotation and position of the board that fit the image nearest to its cell; None if none fit."""
    size = np.array([camera.width_px, camera.height_px])
    best, best_place = -np.inf, None
    for ray in rays:
        # rotate with the ray, so that the board also faces the camera away from the optical axis
        R = _rotation_between(np.array([0.0, 0.0, 1.0]), ray)
        outline = camera.project(rim_m @ R.T + distance_m * ray)
        if (
            not np.all(np.isfinite(outline))
            or outline.min() < MARGIN_PX
            or np.any(outline > size - 1 - MARGIN_PX)
        ):
            continue
        offset = (outline.mean(axis=0) - size / 2) / size
        # move it towards its cell as far as it fits; for the central cell, towards the centre
        merit = float(offset @ towards_cell) - float(np.abs(offset) @ (towards_cell == 0))
        if merit > best:
            best, best_place = merit, (R, np.asarray(distance_m * ray))
    return best_place


def _distance_for_span(camera: Camera, corners_m: FloatArray, span_px: FloatArray) -> float:
    """Return the first of `_DISTANCES` at which corners on the optical axis span less than ``span_px``, or the last."""
    distances = _DISTANCES * float(np.ptp(corners_m, axis=0).max())
    for distance in distances:
        if corners_m[:, 2].min() + distance <= 0:
            continue
        outline = camera.project(corners_m + np.array([0.0, 0.0, distance]))
        if np.all(np.ptp(outline, axis=0) < span_px):
            return float(distance)
    return float(distances[-1])


def _rotation(rotvec_rad: FloatArray) -> FloatArray:
    return matrix_from_quat(quat_from_rotvec(rotvec_rad))


def _rotation_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the smallest rotation that carries one unit vector to another."""
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        # opposite vectors: half a turn about an axis across them
        across = np.eye(3)[np.argmin(np.abs(a))]
        across = across - (across @ a) * a
        return np.eye(3) if a @ b > 0 else _rotation(across / np.linalg.norm(across) * np.pi)
    return _rotation(axis / sine * np.arctan2(sine, float(a @ b)))
