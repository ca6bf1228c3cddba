"""How the target turns: a free or driven tumble, a steady spin, pointing, or the attitude that a file gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from simulator.errors import UserError
from simulator.runtime.arrays import FloatArray, Vec3
from simulator.world.attitude.directions import DirectionName, Surroundings, TwoAxisTrack
from simulator.world.attitude.rigid_body import AttitudeTrack, propagate_attitude
from simulator.world.attitude.torques import NO_TORQUES, Torques, torque_on
from simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.world.orbit.propagation import OrbitTrack

_CHECKED_TIMES = 61


@dataclass(frozen=True, eq=False)
class SteadyTrack:
    """A steady turn, or none: attitude at the start, and the rate in body axes [rad s-1]."""

    q_eci_from_body_wxyz: FloatArray
    omega_rad_s: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """``q_eci_from_body_wxyz`` and the rate."""
        turn = quat_from_rotvec(self.omega_rad_s * t_s)
        return quat_multiply(self.q_eci_from_body_wxyz, turn), self.omega_rad_s


@dataclass(frozen=True, eq=False)
class LvlhTrack:
    """At rest in LVLH."""

    orbit: OrbitTrack
    q_lvlh_from_body_wxyz: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """``q_eci_from_body_wxyz`` and the rate relative to ECI, body axes [rad s-1]."""
        frame = self.orbit.frame(t_s)
        q = quat_multiply(quat_from_matrix(frame.R_eci_from_lvlh), self.q_lvlh_from_body_wxyz)
        turn = frame.R_eci_from_lvlh.T @ frame.omega_eci_rad_s
        return q, matrix_from_quat(self.q_lvlh_from_body_wxyz).T @ turn


@dataclass(frozen=True, kw_only=True)
class Tumble:
    """A rigid body that turns as Euler's equations have it.

    Parameters
    ----------
    omega_rad_s : relative to ECI at the start, body axes. inertia_kg_m2 : (3, 3), body axes.
    torques : that act on it.
    """

    omega_rad_s: ArrayLike
    inertia_kg_m2: ArrayLike
    torques: Torques = NO_TORQUES

    def track(self, q_eci_from_body_wxyz: FloatArray, around: Surroundings) -> AttitudeTrack:
        """The attitude over the flight."""
        torque = torque_on(self.torques, around.orbit, self.inertia_kg_m2, around.epoch)
        return propagate_attitude(
            q_eci_from_body_wxyz, self.omega_rad_s, self.inertia_kg_m2, around.duration_s, torque
        )


@dataclass(frozen=True, kw_only=True)
class Spin:
    """A steady turn about an axis fixed in the body and among the stars.

    Parameters
    ----------
    axis_body : any length but zero. rate_rad_s : right-handed about it.
    """

    axis_body: Vec3
    rate_rad_s: float

    def track(self, q_eci_from_body_wxyz: FloatArray, around: Surroundings) -> AttitudeTrack:  # noqa: ARG002
        """The attitude over the flight."""
        axis = np.array(self.axis_body, float)
        return SteadyTrack(q_eci_from_body_wxyz, axis * (self.rate_rad_s / np.linalg.norm(axis)))


@dataclass(frozen=True, kw_only=True)
class Fixed:
    """At rest among the stars, or in the target's LVLH frame."""

    frame: Literal["eci", "lvlh"]

    def track(self, q_eci_from_body_wxyz: FloatArray, around: Surroundings) -> AttitudeTrack:
        """The attitude over the flight."""
        orbit = around.orbit
        if self.frame == "eci":
            return SteadyTrack(q_eci_from_body_wxyz, np.zeros(3))
        start = orbit.frame(0.0).R_eci_from_lvlh
        q_lvlh_from_body = quat_multiply(quat_from_matrix(start.T), q_eci_from_body_wxyz)
        return LvlhTrack(orbit, q_lvlh_from_body)


@dataclass(frozen=True, kw_only=True)
class Pointed:
    """One axis of the body at a direction, a second as near to another as it can be.

    Parameters
    ----------
    axis_body, at : for example the panel's normal, ``sun``. second_axis_body, second_at : likewise.
    """

    axis_body: Vec3
    at: DirectionName
    second_axis_body: Vec3
    second_at: DirectionName

    def track(self, _q: FloatArray, around: Surroundings) -> AttitudeTrack:
        """The attitude over the flight.

        Raises
        ------
        UserError
            If the two directions run together at some time.
        """
        track = TwoAxisTrack(
            axis_body=self.axis_body,
            toward=around.direction(self.at),
            second_axis_body=self.second_axis_body,
            second_toward=around.direction(self.second_at),
        )
        for t_s in np.linspace(0.0, around.duration_s, _CHECKED_TIMES):
            if track.undefined_at(float(t_s)):
                raise UserError(
                    f"{self.at} and {self.second_at} run together {t_s:.0f} s after the start, which leaves the "
                    "attitude open: choose another second direction for the target"
                )
        return track


@dataclass(frozen=True, eq=False)
class History:
    """An attitude given over time, from a file."""

    given: AttitudeTrack

    def track(self, _q: FloatArray, _around: Surroundings) -> AttitudeTrack:
        """The attitude over the flight."""
        return self.given


TargetMotion = Tumble | Spin | Fixed | Pointed | History
