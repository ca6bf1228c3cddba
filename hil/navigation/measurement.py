"""Pose as a measurement: exposure time, camera attitude and uncertainty; and a noise model to draw one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_multiply

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseMeasurement:
    """Pose of the target in the camera at mid-exposure.

    Parameters
    ----------
    t_s : mid-exposure, time from the flight's start [s].
    q_camera_from_target_wxyz, t_camera_from_target_m : (4,), (3,) pose of the model's frame.
    q_camera_from_eci_wxyz : (4,) attitude of the camera then, known by the star tracker.
    errors : (6, 6) one column for each part of the pose's error, along camera axes and as large as its standard
        deviation: translation [m] along camera axes, turn [rad] about target axes.
    remembered : share of each part's variance that is alike from pose to pose.
    """

    t_s: float
    q_camera_from_target_wxyz: FloatArray
    t_camera_from_target_m: FloatArray
    q_camera_from_eci_wxyz: FloatArray
    errors: FloatArray
    remembered: float

    def new_errors(self, factors: FloatArray | float = 1.0) -> FloatArray:
        """Return the (6, 6) input matrix of six new white errors of unit variance; ``factors`` (6,) scale the
        components.
        """
        return np.asarray(np.sqrt(1.0 - self.remembered) * self.errors * factors)

    def remembered_errors(self, factors: FloatArray | float = 1.0) -> FloatArray:
        """Return the (6, 6) input matrix of six remembered errors of unit variance."""
        return np.asarray(np.sqrt(self.remembered) * self.errors * factors)


@dataclass(frozen=True, kw_only=True)
class ErrorMemory:
    """Correlation of an estimator's errors, which are similar while the view is, because the same shadows bias it.

    Parameters
    ----------
    turn_rad : rotation of the target in the camera after which 1/e of an error is left.
    range_ratio : ratio of ranges after which 1/e is left.
    """

    turn_rad: float = 1.0
    range_ratio: float = 4.0

    def kept(self, turn_rad: float, ratio: float) -> float:
        """Return the share of a remembered error left after a rotation and between two ranges of this ratio."""
        return float(np.exp(-abs(turn_rad) / self.turn_rad - abs(np.log(ratio) / np.log(self.range_ratio))))


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """State of chaser and target at mid-exposure.

    Parameters
    ----------
    t_s : time from the flight's start [s].
    position_eci_m, velocity_eci_m_s : (3,) chaser minus target's centre of mass, GCRS axes.
    q_camera_from_eci_wxyz, omega_camera_rad_s : attitude of the camera, and its rate about its own axes.
    q_eci_from_target_wxyz : (4,) attitude of the target.
    com_target_m : (3,) its centre of mass in the model's frame.
    """

    t_s: float
    position_eci_m: FloatArray
    velocity_eci_m_s: FloatArray
    q_camera_from_eci_wxyz: FloatArray
    omega_camera_rad_s: FloatArray
    q_eci_from_target_wxyz: FloatArray
    com_target_m: FloatArray

    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Return the true ``q_camera_from_target_wxyz`` and ``t_camera_from_target_m`` [m], as in a label."""
        origin = -(matrix_from_quat(self.q_eci_from_target_wxyz) @ self.com_target_m)
        t = matrix_from_quat(self.q_camera_from_eci_wxyz) @ (origin - self.position_eci_m)
        return quat_multiply(self.q_camera_from_eci_wxyz, self.q_eci_from_target_wxyz), t


@dataclass(frozen=True, kw_only=True)
class PoseNoise:
    """Errors of accepted poses: normal, partly remembered from pose to pose; and the rate of poses.

    The defaults are those of the estimator `hybrid` on Tango with the SPEED camera, measured along closed loops with
    the target seen from everywhere (``python -m tools.studies.pose_errors``; docs/hil_closed_loop.md).

    Parameters
    ----------
    across_m, across_share : sigma across the boresight: a length [m], and a share of the range; squares add.
    along_share : sigma along the boresight over the range.
    tilt_rad, roll_rad : sigma of the turn about each axis across the boresight, and about it [rad].
    remembered : share of each variance that is alike from pose to pose, as long as ``memory`` says.
    available : share of the images whose pose is accepted. wrong : share of those that is wrong.
    """

    across_m: float = 6e-4
    across_share: float = 4e-5
    along_share: float = 1.1e-3
    tilt_rad: float = 0.0028
    roll_rad: float = 0.0009
    remembered: float = 0.9
    memory: ErrorMemory = field(default_factory=ErrorMemory)
    available: float = 0.955
    wrong: float = 0.004

    def sigmas(self, range_m: float) -> FloatArray:
        """Return the (6,) standard deviations in camera axes: right, down, forward [m], rotation about the same
        [rad].
        """
        across = float(np.hypot(self.across_m, self.across_share * range_m))
        along = self.along_share * range_m
        return np.array([across, across, along, self.tilt_rad, self.tilt_rad, self.roll_rad])

    def measured(
        self,
        t_s: float,
        q_camera_from_target_wxyz: FloatArray,
        t_camera_from_target_m: FloatArray,
        q_camera_from_eci_wxyz: FloatArray,
    ) -> PoseMeasurement:
        """Return a pose with its error model, for a boresight near the target."""
        errors = self._axes(q_camera_from_target_wxyz) * self.sigmas(
            float(np.linalg.norm(t_camera_from_target_m))
        )
        return PoseMeasurement(
            t_s=t_s,
            q_camera_from_target_wxyz=q_camera_from_target_wxyz,
            t_camera_from_target_m=t_camera_from_target_m,
            q_camera_from_eci_wxyz=q_camera_from_eci_wxyz,
            errors=errors,
            remembered=self.remembered,
        )

    @staticmethod
    def _axes(q_camera_from_target_wxyz: FloatArray) -> FloatArray:
        """Return the (6, 6) matrix from camera axes to those of a pose's errors, whose rotation is about the
        target's axes.
        """
        axes = np.eye(6)
        axes[3:, 3:] = matrix_from_quat(q_camera_from_target_wxyz).T
        return axes
