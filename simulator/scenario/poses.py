"""Frames at a user's list of poses, with the scenario's camera, light and background."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.runtime.untrusted_files import decode_text, read_regular
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.plan import FramePlan
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MAX_BYTES = 200_000_000  # size limit of a list: a million poses
COLUMNS = ("q_w", "q_x", "q_y", "q_z", "t_x_m", "t_y_m", "t_z_m")

# Allowed range of a target [m].
MIN_RANGE_M, MAX_RANGE_M = 0.01, 1e6
_EXTRA_CELLS = "cells beyond the header"


def read_poses(path: Path) -> tuple[Pose, ...]:
    """Read poses of the target in the camera from a CSV file with the header ``q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m``.

    The quaternion is q_camera_from_target, Hamilton, and is normalised. Other columns are ignored.

    Returns
    -------
    tuple of Pose
        ``camera`` from ``target``, one for each line below the header and in their order, with unit quaternion and
        position [m].

    Raises
    ------
    UserError
        If the file cannot be read, lacks a column, has no row, or a number is wrong: file, line, column, remedy.
    """
    try:
        text = decode_text(read_regular(path, MAX_BYTES), str(path))
        reader = csv.DictReader(io.StringIO(text, newline=""), restkey=_EXTRA_CELLS)
        rows = list(reader)
        header = [name.strip() for name in reader.fieldnames or ()]
    except (OSError, csv.Error) as error:
        raise UserError(f"cannot read poses {path}: {error}; give a CSV file with a header line") from error
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise UserError(f"{path} lacks the column {missing[0]}; its first line must name {','.join(COLUMNS)}")
    duplicate = next((name for name in COLUMNS if header.count(name) > 1), None)
    if duplicate is not None:
        raise UserError(f"{path} has the column {duplicate} twice; delete one")
    if not rows:
        raise UserError(f"{path} has no poses; give a line for each picture below the header")
    return tuple(_pose(path, line, row) for line, row in enumerate(rows, start=2))


def _pose(path: Path, line: int, row: dict[str, str]) -> Pose:
    values = []
    if any(cell.strip() for cell in row.get(_EXTRA_CELLS, ())):  # decimal commas leave extra cells
        raise UserError(
            f"{path} line {line} has more cells than the first line; write numbers with a decimal point"
        )
    cells = {(name or "").strip(): text for name, text in row.items()}
    for name in COLUMNS:
        try:
            value = float(cells[name])
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            raise UserError(f"{path} line {line}: {name} is {cells[name]!r}; give a finite number")
        values.append(value)
    return _pose_from_arrays(np.array(values[:4]), np.array(values[4:]), f"{path} line {line}")


def _pose_from_arrays(q: FloatArray, t: FloatArray, source: str) -> Pose:
    """Return the pose of the target in the camera. Raise if it cannot be drawn."""
    if not 0.5 < math.hypot(*q) < 2:
        raise UserError(f"{source}: the quaternion's length is {math.hypot(*q):g}; it must be one")
    if not MIN_RANGE_M < math.hypot(*t) < MAX_RANGE_M:
        raise UserError(
            f"{source}: the target is {math.hypot(*t):g} m away, allowed: {MIN_RANGE_M:g} to {MAX_RANGE_M:g}"
        )
    return Pose.from_arrays("camera", "target", q, t)


@dataclass(frozen=True, eq=False)
class PosePlan:
    """One frame per pose, with the camera and light of ``base``."""

    base: SceneState
    target: Target
    poses: tuple[Pose, ...]

    @property
    def n_frames(self) -> int:
        """Number of poses."""
        return len(self.poses)

    def scene(self, k: int) -> SceneState:
        """Return the scene with the craft at pose k.

        Returns
        -------
        SceneState
            Scene with ``k`` as frame number, see `scene_with_pose`.
        """
        return scene_with_pose(self.base, self.target, self.poses[k], k)


def scene_at(
    plan: FramePlan,
    q_camera_from_target_wxyz: ArrayLike,
    t_camera_from_target_m: ArrayLike,
    *,
    frame: int = 0,
    index: int | None = None,
) -> SceneState:
    """Return a frame's scene with the target at another pose; camera, light and background are the frame's.

    Parameters
    ----------
    plan : FramePlan
        Frames whose scenes are used.
    q_camera_from_target_wxyz : array_like
        (4,) unit quaternion, Hamilton, scalar first; it is normalised.
    t_camera_from_target_m : array_like
        (3,) origin of the target's axes in the camera's: x right, y down, z forward [m].
    frame : int, optional
        Frame of the plan that defines the time.
    index : int, optional
        Number of the image, the key of its noise; by default ``frame``.

    Returns
    -------
    SceneState
        Scene at mid-exposure.

    Raises
    ------
    UserError
        If the pose is not finite, the quaternion not of unit length, the target too near or too far, or the plan has
        no such frame.
    """
    if not 0 <= frame < plan.n_frames or (index is not None and index < 0):
        raise UserError(
            f"frame {frame} with index {index}: the plan has the frames 0 to {plan.n_frames - 1}, an index is 0 or more"
        )
    q, t = (np.asarray(x, float) for x in (q_camera_from_target_wxyz, t_camera_from_target_m))
    if q.shape != (4,) or t.shape != (3,) or not (np.isfinite(q).all() and np.isfinite(t).all()):
        raise UserError(
            f"the pose is {q.tolist()}, {t.tolist()}: give a quaternion of four numbers, scalar first, and a "
            "position of three [m]"
        )
    pose = _pose_from_arrays(q, t, "the pose")
    return scene_with_pose(plan.scene(frame), plan.target, pose, frame if index is None else index)


def scene_with_pose(scene: SceneState, target: Target, pose: Pose, frame_index: int) -> SceneState:
    """Move the craft of a scene to another pose, at rest relative to the camera.

    Returns
    -------
    SceneState
        Copy with ``frame_index`` as its number. The quaternion has ``w >= 0``; the target's state on GCRS axes and
        its sunlight belong to the new pose. Camera, Sun and sky are kept.
    """
    R_eci_from_camera = matrix_from_quat(scene.q_camera_from_eci_wxyz).T
    com = R_eci_from_camera @ pose.apply(np.asarray(target.mass.com_m, float))
    q = np.asarray(pose.q_wxyz)
    # at rest in the image: it rotates with the camera and moves on the corresponding arc
    r_target = np.asarray(scene.r_camera_eci_m) + com
    omega = R_eci_from_camera @ np.asarray(scene.omega_camera_rad_s)
    return replace(
        scene,
        frame_index=frame_index,
        q_camera_from_target_wxyz=quat(q if q[0] >= 0 else -q),
        t_camera_from_target_m=pose.t_m,
        omega_target_rad_s=vec3(pose.R.T @ np.asarray(scene.omega_camera_rad_s)),
        v_target_camera_m_s=(0.0, 0.0, 0.0),
        r_target_eci_m=vec3(r_target),
        v_target_eci_m_s=vec3(np.asarray(scene.v_camera_eci_m_s) + np.cross(omega, com)),
        sun_visible_fraction=sun_fraction_past_bodies(scene.bodies, r_target, scene.r_sun_eci_m),
    )
