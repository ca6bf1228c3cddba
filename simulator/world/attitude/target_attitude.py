"""Attitude of the target: free or torqued tumble, steady spin, inertial or LVLH hold, pointing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import Degrees, DirectionXyz, Rate, Section, TorqueNm
from flyaround.simulator.world.attitude.directions import DirectionName, PointingContext, TwoAxisTrack
from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack, propagate_attitude
from flyaround.simulator.world.attitude.torques import body_torque
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.world.frames.lvlh import Lvlh
    from flyaround.simulator.world.orbit.propagation import OrbitTrack

_CHECKED_TIMES = 61  # number of times in a flight at which pointing is checked


@dataclass(frozen=True, eq=False)
class SteadyTrack:
    """A constant angular velocity, which may be zero.

    Parameters
    ----------
    q_eci_from_body_wxyz : (4,) array
        Attitude at t = 0.
    omega_rad_s : (3,) array
        Angular velocity relative to ECI, body axes.
    """

    q_eci_from_body_wxyz: FloatArray
    omega_rad_s: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` and the rate relative to ECI, body axes [rad s-1]."""
        turn = quat_from_rotvec(self.omega_rad_s * t_s)
        return quat_multiply(self.q_eci_from_body_wxyz, turn), self.omega_rad_s


@dataclass(frozen=True, eq=False)
class LvlhTrack:
    """An attitude fixed in LVLH."""

    orbit: OrbitTrack
    q_lvlh_from_body_wxyz: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` and the rate relative to ECI, body axes [rad s-1]."""
        frame = self.orbit.frame(t_s)
        q = quat_multiply(quat_from_matrix(frame.R_eci_from_lvlh), self.q_lvlh_from_body_wxyz)
        turn = frame.R_eci_from_lvlh.T @ frame.omega_eci_rad_s
        return q, matrix_from_quat(self.q_lvlh_from_body_wxyz).T @ turn


class Point(Section, frozen=True, kw_only=True):
    """Pointing of ``axis`` exactly at ``at``, and of ``second_axis`` as near to ``second_at`` as possible."""

    axis: DirectionXyz
    at: DirectionName
    second_axis: DirectionXyz
    second_at: DirectionName

    def track(self, context: PointingContext) -> TwoAxisTrack:
        """Return the attitude over the flight.

        Returns
        -------
        TwoAxisTrack
            Attitude as a function of the time since the start [s]. The directions are checked at evenly spaced
            times only.

        Raises
        ------
        UserError
            If the two directions are parallel at one of these times.
        """
        track = TwoAxisTrack(
            axis_body=self.axis,
            toward=context.direction(self.at),
            second_axis_body=self.second_axis,
            second_toward=context.direction(self.second_at),
        )
        for t_s in np.linspace(0.0, context.duration_s, _CHECKED_TIMES):
            if track.is_undefined(float(t_s)):
                raise UserError(
                    f"{self.at} and {self.second_at} run together {t_s:.0f} s after the start, which leaves the "
                    "attitude open: choose another second direction for the target"
                )
        return track


class Attitude(Section, frozen=True, kw_only=True):
    """Attitude of the target at the epoch, and its motion from then on.

    ``q_wxyz`` is ``q_frame_from_target`` (Hamilton, scalar first); alternatively ``euler_deg`` gives yaw, pitch, roll
    (rotations about z, then the new y, then the new x) from the frame's axes to the target's, or ``aem_file`` names a
    CCSDS attitude ephemeris message. ``rate_deg_s`` is the angular velocity relative to the stars, target axes.

    ``motion``: ``tumble`` as a rigid body, free or under the torques below; ``spin`` steadily by ``rate_deg_s`` about
    an inertially fixed axis; ``fixed`` in ``frame``; ``point`` as in section ``point``; ``aem`` follows the file during
    the flight.
    """

    motion: Literal["tumble", "spin", "fixed", "point", "aem"] = "tumble"
    frame: Literal["eci", "lvlh"] = "lvlh"
    q_wxyz: tuple[float, float, float, float] | None = None
    euler_deg: tuple[Degrees, Degrees, Degrees] | None = None
    rate_deg_s: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)
    aem_file: str | None = None
    point: Point | None = None
    gravity_gradient: bool = False
    torque_body_nm: tuple[TorqueNm, TorqueNm, TorqueNm] = (0.0, 0.0, 0.0)
    residual_dipole_a_m2: tuple[TorqueNm, TorqueNm, TorqueNm] = (0.0, 0.0, 0.0)
    inertia_kg_m2: (
        tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]] | None
    ) = None

    def q_eci_from_target_wxyz(self, frame: Lvlh) -> FloatArray:
        """Return the attitude at the start of the flight, for the target's LVLH ``frame`` at that time.

        Returns
        -------
        (4,) array
            Unit quaternion ``q_eci_from_target``, Hamilton, scalar first. Without ``q_wxyz`` and ``euler_deg`` the
            target's axes are those of ``self.frame``; the attitude of an ``aem_file`` counts only after it has been
            read into ``q_wxyz``.
        """
        q = np.array([1.0, 0.0, 0.0, 0.0])
        if self.q_wxyz is not None:
            q = quat_normalize(self.q_wxyz)
        elif self.euler_deg is not None:
            yaw, pitch, roll = np.radians(self.euler_deg)
            yaw_rotation, pitch_rotation = (
                quat_from_rotvec([0.0, 0.0, yaw]),
                quat_from_rotvec([0.0, pitch, 0.0]),
            )
            q = quat_multiply(quat_multiply(yaw_rotation, pitch_rotation), quat_from_rotvec([roll, 0.0, 0.0]))
        if self.frame == "lvlh":
            q = quat_multiply(quat_from_matrix(frame.R_eci_from_lvlh), q)
        return q

    def track(
        self, q_eci_from_body_wxyz: FloatArray, inertia_kg_m2: ArrayLike, context: PointingContext
    ) -> AttitudeTrack:
        """Return the attitude over the flight, unless a file defines it.

        Parameters
        ----------
        q_eci_from_body_wxyz : (4,) array
            Initial attitude.
        inertia_kg_m2 : array_like
            (3, 3) inertia of the target's model, body axes; used if the section gives none.
        context : PointingContext
            Orbit of the target and the directions that it may point at.

        Returns
        -------
        AttitudeTrack
            Attitude and rate [rad s-1] over the flight.

        Raises
        ------
        UserError
            If two directions that the target points at are parallel at some time.
        """
        rate = np.radians(self.rate_deg_s)
        if self.motion == "spin":
            return SteadyTrack(q_eci_from_body_wxyz, rate)
        if self.motion == "point" and self.point is not None:
            return self.point.track(context)
        if self.motion == "fixed" and self.frame == "eci":
            return SteadyTrack(q_eci_from_body_wxyz, np.zeros(3))
        if self.motion == "fixed":
            start = context.orbit.frame(0.0).R_eci_from_lvlh
            return LvlhTrack(context.orbit, quat_multiply(quat_from_matrix(start.T), q_eci_from_body_wxyz))
        inertia = np.asarray(self.inertia_kg_m2 or inertia_kg_m2, float)
        torque = body_torque(
            context.orbit,
            inertia,
            context.epoch,
            constant_nm=self.torque_body_nm,
            gravity_gradient=self.gravity_gradient,
            residual_dipole_a_m2=self.residual_dipole_a_m2,
        )
        return propagate_attitude(q_eci_from_body_wxyz, rate, inertia, context.duration_s, torque)
