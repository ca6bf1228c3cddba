"""Pose measurements for the navigation filter, and their noise model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_multiply

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseMeasurement:
    """Pose of the target relative to the camera, measured at mid-exposure.

    Parameters
    ----------
    t_s : float
        Time of mid-exposure since the start of the flight [s].
    q_camera_from_target_wxyz : (4,) array
        Measured attitude quaternion.
    t_camera_from_target_m : (3,) array
        Measured position of the model's origin, camera frame [m].
    q_camera_from_eci_wxyz : (4,) array
        Attitude of the camera at that time, known from the star tracker.
    errors : (6, 6) array
        Square root of the error covariance, one column per independent error. Rows are translation in camera axes [m],
        then rotation in target axes [rad].
    correlated_share : float
        Share of each error's variance that is correlated between successive poses.
    """

    t_s: float
    q_camera_from_target_wxyz: FloatArray
    t_camera_from_target_m: FloatArray
    q_camera_from_eci_wxyz: FloatArray
    errors: FloatArray
    correlated_share: float

    def new_errors(self, factors: FloatArray | float = 1.0) -> FloatArray:
        """Return the input matrix (6, 6) of the white part of the errors, driven by unit-variance noise.

        Parameters
        ----------
        factors : (6,) array or float, optional
            Scale factors of the errors.

        Returns
        -------
        (6, 6) array
            Input matrix.
        """
        return np.asarray(np.sqrt(1.0 - self.correlated_share) * self.errors * factors)

    def correlated_errors(self, factors: FloatArray | float = 1.0) -> FloatArray:
        """Return the input matrix (6, 6) of the correlated part of the errors; see `new_errors`."""
        return np.asarray(np.sqrt(self.correlated_share) * self.errors * factors)


@dataclass(frozen=True, kw_only=True)
class ErrorCorrelation:
    """Correlation of an estimator's errors between views: in similar views the same shadows cause similar errors.

    Parameters
    ----------
    turn_rad : float, optional
        Rotation of the target relative to the camera at which the correlation has fallen to 1/e.
    range_ratio : float, optional
        Ratio of ranges at which the correlation has fallen to 1/e.
    """

    turn_rad: float = 1.0
    range_ratio: float = 4.0

    def correlation(self, turn_rad: float, ratio: float) -> float:
        """Return the correlation of the errors of two views.

        Parameters
        ----------
        turn_rad : float
            Rotation of the target between the views.
        ratio : float
            Ratio of the ranges.
        """
        return float(np.exp(-abs(turn_rad) / self.turn_rad - abs(np.log(ratio) / np.log(self.range_ratio))))


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """State of chaser and target at mid-exposure.

    Parameters
    ----------
    t_s : float
        Time since the start of the flight [s].
    position_eci_m : (3,) array
        Chaser minus target's centre of mass, GCRS axes.
    velocity_eci_m_s : (3,) array
        Velocity of the chaser relative to the target, GCRS axes.
    q_camera_from_eci_wxyz : (4,) array
        Attitude of the camera.
    omega_camera_rad_s : (3,) array
        Angular rate of the camera, its own axes.
    q_eci_from_target_wxyz : (4,) array
        Attitude of the target.
    com_target_m : (3,) array
        Centre of mass of the target, model frame.
    """

    t_s: float
    position_eci_m: FloatArray
    velocity_eci_m_s: FloatArray
    q_camera_from_eci_wxyz: FloatArray
    omega_camera_rad_s: FloatArray
    q_eci_from_target_wxyz: FloatArray
    com_target_m: FloatArray

    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Return the true pose of the target, as in a label.

        Returns
        -------
        q_camera_from_target_wxyz : (4,) array
            Attitude quaternion, scalar first.
        t_camera_from_target_m : (3,) array
            Position of the model's origin, camera frame [m].
        """
        origin = -(matrix_from_quat(self.q_eci_from_target_wxyz) @ self.com_target_m)
        t = matrix_from_quat(self.q_camera_from_eci_wxyz) @ (origin - self.position_eci_m)
        return quat_multiply(self.q_camera_from_eci_wxyz, self.q_eci_from_target_wxyz), t


@dataclass(frozen=True, kw_only=True)
class PoseNoise:
    """Noise model of accepted poses: partly correlated normal errors, and rates of loss and failure.

    The defaults describe the estimator `hybrid` on Tango with the SPEED camera in closed loops, averaged over all views
    of the target (``python -m tools.studies.pose_errors``; docs/hil_closed_loop.md).

    Parameters
    ----------
    across_m : float, optional
        Constant part of the standard deviation across the boresight; added in quadrature to ``across_share``.
    across_share : float, optional
        Part of the standard deviation across the boresight that is proportional to range.
    along_share : float, optional
        Standard deviation along the boresight, as a share of the range.
    tilt_rad : float, optional
        Standard deviation of the rotation about each axis perpendicular to the boresight.
    roll_rad : float, optional
        Standard deviation of the rotation about the boresight.
    correlated_share : float, optional
        Share of each variance that is correlated between successive poses.
    memory : ErrorCorrelation, optional
        Decay of that correlation as the view changes.
    available : float, optional
        Share of the images whose pose is accepted.
    wrong : float, optional
        Share of the accepted poses that are grossly wrong.
    """

    across_m: float = 6e-4
    across_share: float = 4e-5
    along_share: float = 1.1e-3
    tilt_rad: float = 0.0028
    roll_rad: float = 0.0009
    correlated_share: float = 0.9
    memory: ErrorCorrelation = field(default_factory=ErrorCorrelation)
    available: float = 0.955
    wrong: float = 0.004

    def sigmas(self, range_m: float) -> FloatArray:
        """Return the standard deviations of a pose at a range [m], in camera axes.

        Returns
        -------
        (6,) array
            Translation in x, y and z [m], then rotation about these axes [rad].
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
        """Make a measurement from a pose and this error model; the target must be near the boresight.

        Returns
        -------
        PoseMeasurement
            The pose unchanged, with the error covariance of this model at its range.
        """
        errors = self._axes(q_camera_from_target_wxyz) * self.sigmas(
            float(np.linalg.norm(t_camera_from_target_m))
        )
        return PoseMeasurement(
            t_s=t_s,
            q_camera_from_target_wxyz=q_camera_from_target_wxyz,
            t_camera_from_target_m=t_camera_from_target_m,
            q_camera_from_eci_wxyz=q_camera_from_eci_wxyz,
            errors=errors,
            correlated_share=self.correlated_share,
        )

    def true_pose(self, snapshot: Snapshot) -> PoseMeasurement:
        """Return the exact pose of a snapshot as a measurement.

        Returns
        -------
        PoseMeasurement
            Pose without errors, of which the filter nevertheless assumes this accuracy.
        """
        return self.measured(snapshot.t_s, *snapshot.pose(), snapshot.q_camera_from_eci_wxyz)

    @staticmethod
    def _axes(q_camera_from_target_wxyz: FloatArray) -> FloatArray:
        """Return the matrix (6, 6) that converts errors from camera axes, rotations to target axes."""
        axes = np.eye(6)
        axes[3:, 3:] = matrix_from_quat(q_camera_from_target_wxyz).T
        return axes
