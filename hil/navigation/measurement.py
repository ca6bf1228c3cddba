"""A pose as a measurement: when it was exposed, where the camera looked, how sure it is; and noise to draw one by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
)

if TYPE_CHECKING:
    from numpy.random import Generator

    from simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseMeasurement:
    """A pose of the target in the camera, by its mid-exposure.

    Parameters
    ----------
    t_s : mid-exposure, from the flight's start [s].
    q_camera_from_target_wxyz, t_camera_from_target_m : (4,), (3,) pose of the model's frame.
    q_camera_from_eci_wxyz : (4,) attitude of the camera then, which the chaser knows by its star tracker.
    covariance : (6, 6) of the translation along camera axes [m] and of the turn about target axes [rad].
    """

    t_s: float
    q_camera_from_target_wxyz: FloatArray
    t_camera_from_target_m: FloatArray
    q_camera_from_eci_wxyz: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """What a camera looks at: chaser and target at mid-exposure.

    Parameters
    ----------
    t_s : from the flight's start [s].
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
        """The true ``q_camera_from_target_wxyz`` and ``t_camera_from_target_m`` [m], as a picture's label has them."""
        origin = -(matrix_from_quat(self.q_eci_from_target_wxyz) @ self.com_target_m)
        t = matrix_from_quat(self.q_camera_from_eci_wxyz) @ (origin - self.position_eci_m)
        return quat_multiply(self.q_camera_from_eci_wxyz, self.q_eci_from_target_wxyz), t


@dataclass(frozen=True, kw_only=True)
class PoseNoise:
    """Errors of accepted poses, normal and without correlation; how often there is one.

    The defaults are the RMS errors of the estimator `svd` on Tango with the SPEED camera over 191 accepted poses of 200
    feasible frames (``eval-black`` seed 2501, ``eval-earth`` seed 2502; docs/hil_closed_loop.md); the share of
    wrong ones is that of docs/svd.md.

    Parameters
    ----------
    lateral_share : sigma across the boresight over the range.
    boresight_m : sigma along the boresight at 10 m [m]; it grows with the square of the range, from
        ``boresight_least_m`` on. turn_rad : sigma of the turn about each axis [rad].
    available : share of the pictures whose pose is accepted. wrong : share of those that is wrong.
    """

    lateral_share: float = 1.9e-4
    boresight_m: float = 0.014
    boresight_least_m: float = 0.006
    turn_rad: float = 0.0021
    available: float = 0.955
    wrong: float = 0.004

    def sigmas(self, range_m: float) -> FloatArray:
        """(6,) standard deviations: right, down, forward [m], turn about three axes [rad]."""
        across = self.lateral_share * range_m
        along = max(self.boresight_m * (range_m / 10.0) ** 2, self.boresight_least_m)
        return np.array([across, across, along, *[self.turn_rad] * 3])

    def covariance(self, t_camera_from_target_m: FloatArray) -> FloatArray:
        """(6, 6) of `PoseMeasurement`, for the boresight near the target."""
        return np.diag(self.sigmas(float(np.linalg.norm(t_camera_from_target_m))) ** 2)

    def draw(self, snapshot: Snapshot, rng: Generator) -> PoseMeasurement | None:
        """A pose of a snapshot with errors drawn; None where none is accepted.

        A wrong one is turned by any angle, and a tenth of the range away.
        """
        q, t = snapshot.pose()
        covariance = self.covariance(t)
        # the same numbers are drawn whatever becomes of them, so that runs differ by their seed alone
        error = np.sqrt(np.diag(covariance)) * rng.standard_normal(6)
        is_there, is_wrong = rng.random(2) < (self.available, self.wrong)
        anywhere = rng.standard_normal(7)
        if not is_there:
            return None
        if is_wrong:
            error = np.concatenate([0.1 * np.linalg.norm(t) * anywhere[:3], 2.0 * anywhere[3:6]])
        return PoseMeasurement(
            t_s=snapshot.t_s,
            q_camera_from_target_wxyz=quat_multiply(q, quat_from_rotvec(error[3:])),
            t_camera_from_target_m=t + error[:3],
            q_camera_from_eci_wxyz=snapshot.q_camera_from_eci_wxyz,
            covariance=covariance,
        )


def rotvec_between(q_a_from_b_wxyz: FloatArray, q_a_from_c_wxyz: FloatArray) -> FloatArray:
    """(3,) turn about b's axes that carries b to c [rad]; the shorter of the two ways round."""
    d = quat_multiply(quat_conjugate(q_a_from_b_wxyz), q_a_from_c_wxyz)
    d = d if d[0] >= 0 else -d
    sine = float(np.linalg.norm(d[1:]))
    if sine < 1e-12:
        return np.asarray(2.0 * d[1:])
    return np.asarray(2.0 * np.arctan2(sine, d[0]) / sine * d[1:])
