"""Errors of an estimated pose against its truth, and the limits of coarse and fine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.frames.rotation import (
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    rotation_angle_rad,
    rotvec_from_quat,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Limits of coarse and fine success: attitude error [deg], and position error over range. Definitions of
# docs/formats/metrics.md, on which published figures depend.
COARSE_DEG, COARSE_SHARE = 5.0, 0.05
FINE_DEG, FINE_SHARE = 0.5, 0.005


class FrameScore(msgspec.Struct, frozen=True, kw_only=True):
    """Answer to one frame, scored against its truth.

    Parameters
    ----------
    range_m : float
        True distance of the target's origin from the camera [m].
    E_T_m : float or None
        Position error of the best pose [m]; None without a pose.
    e_t : float or None
        Position error over range; None without a pose.
    E_R_deg : float or None
        Attitude error [deg]; None without a pose.
    accepted : bool
        True if the estimator accepted its pose.
    feasible : bool, optional
        True if the frame can be solved.
    frame_class : str, optional
        Class of the frame for reports, e.g. ``feasible``, ``dark``, ``cropped``.
    shift_camera_m : (3,) tuple of float, optional
        Estimated minus true position, camera axes [m].
    turn_camera_deg : (3,) tuple of float, optional
        Rotation vector from true to estimated attitude, camera axes [deg].
    nees : float, optional
        Normalised estimation error squared, six degrees of freedom, by the estimator's covariance; None without one.
    """

    range_m: float
    E_T_m: float | None
    e_t: float | None
    E_R_deg: float | None
    accepted: bool
    feasible: bool = True
    frame_class: str = ""
    shift_camera_m: tuple[float, float, float] | None = None
    turn_camera_deg: tuple[float, float, float] | None = None
    nees: float | None = None

    @property
    def coarse(self) -> bool:
        """True if within 5 deg and 5 % of the range."""
        return _within(self, COARSE_DEG, COARSE_SHARE)

    @property
    def fine(self) -> bool:
        """True if within 0.5 deg and 0.5 % of the range."""
        return _within(self, FINE_DEG, FINE_SHARE)


def frame_errors(
    q_true_wxyz: ArrayLike, t_true_m: ArrayLike, q_est_wxyz: ArrayLike, t_est_m: ArrayLike
) -> tuple[float, float, float]:
    """Return the errors of one pose: ``E_T`` [m], ``e_t = E_T / |t|`` [1], ``E_R`` [deg].

    Parameters
    ----------
    q_true_wxyz : (4,) array
        True ``q_camera_from_target``, either sign, any length.
    t_true_m : (3,) array
        True target position, camera frame [m].
    q_est_wxyz : (4,) array
        Estimated ``q_camera_from_target``, either sign, any length.
    t_est_m : (3,) array
        Estimated target position, camera frame [m].

    Returns
    -------
    tuple of float
        ``E_T`` [m], ``e_t`` [1] and ``E_R`` [deg].

    Raises
    ------
    ValueError
        If a value is not finite, a quaternion is zero, or the true range is zero.
    """
    q, p = np.asarray(q_true_wxyz, float), np.asarray(q_est_wxyz, float)
    t, s = np.asarray(t_true_m, float), np.asarray(t_est_m, float)
    range_m = float(np.linalg.norm(t))
    sizes = [float(np.linalg.norm(q)), float(np.linalg.norm(p)), range_m]
    if not all(np.isfinite(v).all() for v in (q, p, t, s)) or min(sizes) < 1e-9:
        raise ValueError("pose errors need finite poses, non-zero quaternions and a non-zero range")
    E_T = float(np.linalg.norm(s - t))
    return E_T, E_T / range_m, float(np.degrees(rotation_angle_rad(q, p)))


def frame_record(
    q_true_wxyz: ArrayLike,
    t_true_m: ArrayLike,
    q_est_wxyz: ArrayLike | None,
    t_est_m: ArrayLike | None,
    *,
    accepted: bool,
    feasible: bool = True,
    frame_class: str = "",
    covariance: ArrayLike | None = None,
) -> FrameScore:
    """Return the score of one frame; without an estimate its errors are None.

    Parameters
    ----------
    q_true_wxyz : (4,) array
        True ``q_camera_from_target``.
    t_true_m : (3,) array
        True target position, camera frame [m].
    q_est_wxyz : (4,) array or None
        Estimated ``q_camera_from_target``; None without an estimate.
    t_est_m : (3,) array or None
        Estimated target position, camera frame [m]; None without an estimate.
    accepted : bool
        True if the estimator accepted its pose.
    feasible : bool, optional
        True if the frame can be solved.
    frame_class : str, optional
        Class of the frame for reports.
    covariance : (6, 6) array, optional
        Covariance of rotation [rad] and translation [m], camera axes, from the estimator.

    Returns
    -------
    FrameScore
        Errors in metres and degrees, and whether the pose is coarse or fine.

    Raises
    ------
    ValueError
        If a value is not finite, a quaternion is zero, the true range is zero, or a frame is accepted without a pose.
    """
    range_m = float(np.linalg.norm(np.asarray(t_true_m, float)))
    shift = turn = nees = None
    if q_est_wxyz is None or t_est_m is None:
        if accepted:
            raise ValueError("a frame cannot be accepted without a pose")
        E_T = e_t = E_R = None
    else:
        E_T, e_t, E_R = frame_errors(q_true_wxyz, t_true_m, q_est_wxyz, t_est_m)
        shift = vec3(np.asarray(t_est_m, float) - np.asarray(t_true_m, float))
        # R_est R_true', in camera axes
        between = quat_multiply(quat_normalize(q_est_wxyz), quat_conjugate(quat_normalize(q_true_wxyz)))
        turn = vec3(np.degrees(rotvec_from_quat(between)))
        nees = _nees(np.concatenate([np.radians(turn), shift]), covariance)
    return FrameScore(
        range_m=range_m,
        E_T_m=E_T,
        e_t=e_t,
        E_R_deg=E_R,
        accepted=accepted,
        feasible=feasible,
        frame_class=frame_class or ("feasible" if feasible else "infeasible"),
        shift_camera_m=shift,
        turn_camera_deg=turn,
        nees=nees,
    )


def _nees(error: np.ndarray, covariance: ArrayLike | None) -> float | None:
    """Return the normalised squared error of (6,) errors; None if the covariance is missing or singular."""
    if covariance is None:
        return None
    C = np.asarray(covariance, float)
    if C.shape != (6, 6) or not np.isfinite(C).all():
        return None
    variances, axes = np.linalg.eigh(C)
    # a variance within rounding errors is meaningless
    if variances[0] <= np.finfo(float).eps * variances[-1]:
        return None
    return float(np.sum((axes.T @ error) ** 2 / variances))


def _within(r: FrameScore, deg: float, share: float) -> bool:
    return r.E_R_deg is not None and r.e_t is not None and r.E_R_deg <= deg and r.e_t <= share
