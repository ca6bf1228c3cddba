"""Row poses of a rolling shutter: interpolation to a row, and their check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
)

if TYPE_CHECKING:
    from flyaround.simulator.labels.truth import Truth


def pose_of_row(truth: Truth, row: float) -> Pose:
    """Interpolate the pose of the craft at a row; the record's own for a global shutter."""
    poses = truth.row_poses
    if len(poses) < 2:
        return Pose.from_arrays(
            "camera", "target", truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m
        )
    k = int(np.clip(np.searchsorted([p.row_px for p in poses], row) - 1, 0, len(poses) - 2))
    a, b = poses[k], poses[k + 1]
    share = np.clip((row - a.row_px) / (b.row_px - a.row_px), 0, 1)
    turn = quat_multiply(b.q_camera_from_target_wxyz, quat_conjugate(a.q_camera_from_target_wxyz))
    turn = turn if turn[0] >= 0 else -turn
    sine = float(np.linalg.norm(turn[1:]))
    axis = turn[1:] / sine if sine > 0 else np.zeros(3)
    part = quat_from_rotvec(axis * 2 * np.arctan2(sine, turn[0]) * share)
    t = (1 - share) * np.asarray(a.t_camera_from_target_m) + share * np.asarray(b.t_camera_from_target_m)
    return Pose.from_arrays("camera", "target", quat_multiply(part, a.q_camera_from_target_wxyz), t)


def check_rows(truth: Truth) -> list[str]:
    """Check row poses: ordered in time, around the record's own pose, and consistent with the scene's rates."""
    scene, poses = truth.scene, truth.row_poses
    if scene.shutter.is_rolling != bool(poses):
        return ["row poses and the shutter's kind disagree"]
    if not poses:
        return []
    height = truth.camera.height_px
    rows = [p.row_px for p in poses]
    times = (np.array(rows) - (height - 1) / 2) * scene.shutter.readout_s / height
    if rows != sorted(set(rows)) or rows[0] != 0 or rows[-1] != height - 1:
        return ["row poses do not go from the first row to the last"]
    if not np.allclose([p.dt_s for p in poses], times, rtol=0, atol=1e-9):
        return ["the times of the row poses are not the shutter's"]
    R_ct = matrix_from_quat(truth.q_camera_from_target_wxyz)
    rate = R_ct @ np.asarray(scene.omega_target_rad_s) - np.asarray(scene.omega_camera_rad_s)
    t0, v = np.asarray(truth.t_camera_from_target_m), np.asarray(scene.v_target_camera_m_s)
    reach = np.linalg.norm(scene.omega_camera_rad_s) + np.linalg.norm(scene.omega_target_rad_s)
    for pose in poses:
        # rates are constant to first order; the remainder grows with the square of the rotation
        rotation_rad = reach * abs(pose.dt_s)
        turn = matrix_from_quat(pose.q_camera_from_target_wxyz) @ R_ct.T
        angle = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        # and rounding of the recorded numbers
        if np.linalg.norm(angle - rate * pose.dt_s) > 1e-7 + rotation_rad**2:
            return [f"the pose of row {pose.row_px} is not turned as the rates say"]
        shift = np.asarray(pose.t_camera_from_target_m) - t0 - v * pose.dt_s
        # and relative accelerations of up to 2e-4 m s-2, those of low orbits 50 m apart (three times n squared times x)
        if np.linalg.norm(shift) > 1e-6 + rotation_rad**2 * (np.linalg.norm(t0) + 1) + 1e-4 * pose.dt_s**2:
            return [f"the pose of row {pose.row_px} is not moved as the velocity says"]
    return []
