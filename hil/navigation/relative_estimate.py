"""Relative estimate: chaser relative to target, the target's attitude and rate, and their covariance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.navigation.error_scale import ErrorScale
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    rotvec_between,
)
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

# Maximum integration step [s].
_LONGEST_STEP_S = 1.0

P, V, A, W, B = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 18)
"""Slices of the error state: position, velocity, attitude, rate, and the correlated pose errors."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RelativeEstimate:
    """State of chaser and target, with the covariance of its errors.

    Parameters
    ----------
    t_s : float
        Time since the start of the flight [s].
    position_lvlh_m : (3,) array
        Chaser minus target's centre of mass, in the rotating LVLH frame.
    velocity_lvlh_m_s : (3,) array
        Velocity in that frame.
    q_eci_from_target_wxyz : (4,) array
        Attitude of the target.
    omega_target_rad_s : (3,) array
        Angular rate of the target relative to ECI, target axes.
    joint_covariance : (18, 18) array
        Covariance of the errors of position [m], velocity [m s-1], attitude (rotation about target axes) [rad], rate
        [rad s-1] and ``pose_bias``.
    pose_bias : (6,) array, optional
        Correlated part of the pose errors, each of unit variance (`PoseMeasurement`).
    error_scale : ErrorScale, optional
        Scale of those errors in this view.
    """

    t_s: float
    position_lvlh_m: FloatArray
    velocity_lvlh_m_s: FloatArray
    q_eci_from_target_wxyz: FloatArray
    omega_target_rad_s: FloatArray
    joint_covariance: FloatArray
    pose_bias: FloatArray = field(default_factory=lambda: np.zeros(6))
    error_scale: ErrorScale = field(default_factory=ErrorScale)

    @property
    def covariance(self) -> FloatArray:
        """Covariance (12, 12) of position, velocity, attitude and rate, marginalised over the pose errors."""
        return self.joint_covariance[:12, :12]

    @property
    def position_sigma_m(self) -> float:
        """Largest standard deviation of the position [m]."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance[P, P])[-1], 0.0)))

    @property
    def attitude_sigma_rad(self) -> float:
        """Largest standard deviation of the attitude [rad]."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance[A, A])[-1], 0.0)))

    def corrected(self, error: FloatArray, covariance: FloatArray) -> RelativeEstimate:
        """Return the estimate with an error (18,) removed.

        The attitude error is multiplicative (Lefferts, Markley & Shuster 1982).

        Returns
        -------
        RelativeEstimate
            Copy with ``error``, truth minus estimate in the order of the covariance, added to its values, and the given
            covariance.
        """
        attitude = quat_multiply(self.q_eci_from_target_wxyz, quat_from_rotvec(error[A]))
        return replace(
            self,
            position_lvlh_m=self.position_lvlh_m + error[P],
            velocity_lvlh_m_s=self.velocity_lvlh_m_s + error[V],
            q_eci_from_target_wxyz=quat_normalize(attitude),
            omega_target_rad_s=self.omega_target_rad_s + error[W],
            joint_covariance=covariance,
            pose_bias=self.pose_bias + error[B],
        )

    def with_decayed_bias(self, correlation: float) -> RelativeEstimate:
        """Return the estimate with the correlated pose errors decayed to a share ``correlation``.

        A first-order Gauss-Markov process of unit variance: white noise replaces the decayed part.

        Returns
        -------
        RelativeEstimate
            Copy with another ``pose_bias`` and covariance; the other values are the same.
        """
        keep = np.ones(18)
        keep[B] = correlation
        covariance = self.joint_covariance * np.outer(keep, keep)
        covariance[B, B] += (1.0 - correlation * correlation) * np.eye(6)
        return replace(self, joint_covariance=covariance, pose_bias=correlation * self.pose_bias)

    def with_scaled_errors(self, scale: ErrorScale) -> RelativeEstimate:
        """Return the estimate with the pose errors rescaled to another belief.

        The part of the estimate's error that is caused by correlated pose errors scales with them; their estimated
        values [m, rad] are kept.

        Returns
        -------
        RelativeEstimate
            Copy with another ``pose_bias``, covariance and scale; the other values are the same.
        """
        ratio = scale.factors / self.error_scale.factors
        C = self.joint_covariance
        # regression of the twelve states' errors on the six correlated pose errors
        gain = np.linalg.solve(C[B, B], C[B, :12]).T
        grown = np.eye(18)
        grown[:12, B] = gain * (ratio - 1.0)
        covariance = grown @ C @ grown.T
        return replace(
            self,
            joint_covariance=(covariance + covariance.T) / 2,
            pose_bias=self.pose_bias / ratio,
            error_scale=scale,
        )

    def error_of(
        self,
        position_lvlh_m: FloatArray,
        velocity_lvlh_m_s: FloatArray,
        q_eci_from_target_wxyz: FloatArray,
        omega_target_rad_s: FloatArray,
    ) -> FloatArray:
        """Return the error of the estimate.

        Returns
        -------
        (12,) array
            Truth minus estimate: position [m], velocity [m s-1], rotation about target axes [rad], rate [rad s-1].
        """
        return np.concatenate(
            [
                position_lvlh_m - self.position_lvlh_m,
                velocity_lvlh_m_s - self.velocity_lvlh_m_s,
                rotvec_between(self.q_eci_from_target_wxyz, q_eci_from_target_wxyz),
                omega_target_rad_s - self.omega_target_rad_s,
            ]
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class ThrustInterval:
    """Thrust commanded over an interval [s]: acceleration (3,) [m s-2] along the LVLH axes at its start.

    The direction is constant in inertial space, while the LVLH axes rotate.
    """

    start_s: float
    end_s: float
    acceleration_lvlh_m_s2: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionModel:
    """Propagation of an estimate: Clohessy-Wiltshire with commanded thrust, and a free rigid target.

    Parameters
    ----------
    n_rad_s : float
        Mean motion of the target's orbit, assumed circular.
    inertia_kg_m2 : (3, 3) array, optional
        Inertia of the target, own axes, up to a factor; None for a constant rate.
    acceleration_noise : float, optional
        Density of the unmodelled white acceleration [m s-2 Hz-1/2].
    rate_noise : float, optional
        Density of the target's white angular acceleration [rad s-2 Hz-1/2].
    thrust_sigma : float, optional
        Sigma of the delivered relative to the commanded thrust, independent for each axis and period.
    """

    n_rad_s: float
    inertia_kg_m2: FloatArray | None = None
    acceleration_noise: float = 3e-7
    rate_noise: float = 2e-8
    thrust_sigma: float = 0.02

    def propagated(
        self, estimate: RelativeEstimate, to_s: float, thrust: Sequence[ThrustInterval] = ()
    ) -> RelativeEstimate:
        """Return the estimate at a later time.

        Parameters
        ----------
        estimate : RelativeEstimate
            Estimate at its own time.
        to_s : float
            Time of the result, no earlier than the estimate's.
        thrust : sequence of ThrustInterval, optional
            Commanded thrust; the chaser coasts in between.

        Returns
        -------
        RelativeEstimate
            Estimate with its grown covariance.

        Raises
        ------
        ValueError
            If ``to_s`` is earlier than the estimate.

        References
        ----------
        Clohessy & Wiltshire (1960); Lefferts, Markley & Shuster (1982), Kalman filtering for spacecraft attitude
        estimation, J. Guidance 5(5); Bar-Shalom, Li & Kirubarajan (2001), Estimation with Applications to Tracking
        and Navigation, sec. 6.2 (white acceleration).
        """
        start = estimate.t_s
        if to_s < start - 1e-9:
            raise ValueError(f"an estimate of {start} s cannot be propagated back to {to_s} s")
        active = [i for i in thrust if i.end_s > start + 1e-9 and i.start_s < to_s - 1e-9]
        edges = {start, to_s, *(e for i in active for e in (i.start_s, i.end_s) if start < e < to_s)}
        ordered = sorted(edges)
        for a, b in pairwise(ordered):
            now = next((i for i in active if i.start_s <= a + 1e-9 < i.end_s), None)
            pieces = max(int(np.ceil((b - a) / _LONGEST_STEP_S - 1e-9)), 1)
            for _ in range(pieces):
                estimate = self._step(estimate, (b - a) / pieces, now)
        return estimate

    def _step(self, estimate: RelativeEstimate, h: float, thrust: ThrustInterval | None) -> RelativeEstimate:
        Phi = np.eye(18)
        Phi[:6, :6] = transition_matrix(self.n_rad_s, h)
        Phi[6:12, 6:12] = self._attitude_transition(estimate.omega_target_rad_s, h)
        propagated_state = Phi[:6, :6] @ np.concatenate(
            [estimate.position_lvlh_m, estimate.velocity_lvlh_m_s]
        )
        Q = np.zeros((18, 18))
        I3 = np.eye(3)
        for at, density in ((0, self.acceleration_noise), (6, self.rate_noise)):
            white = density * density
            Q[at : at + 3, at : at + 3] = white * h**3 / 3 * I3
            Q[at : at + 3, at + 3 : at + 6] = Q[at + 3 : at + 6, at : at + 3] = white * h * h / 2 * I3
            Q[at + 3 : at + 6, at + 3 : at + 6] = white * h * I3
        if thrust is not None:
            push, since = thrust.acceleration_lvlh_m_s2, estimate.t_s - thrust.start_s
            # Simpson's rule over the step: thrust at tau acts for the remaining h - tau
            pushes = (self._thrust_effect(push, since + tau, h - tau) for tau in (0.0, h / 2, h))
            first, middle, last = pushes
            propagated_state = propagated_state + h / 6 * (first + 4 * middle + last)
            G = np.vstack([h * h / 2 * I3, h * I3])
            Q[:6, :6] += G @ np.diag((self.thrust_sigma * push) ** 2) @ G.T
        q, w = self._step_attitude(estimate.q_eci_from_target_wxyz, estimate.omega_target_rad_s, h)
        return replace(
            estimate,
            t_s=estimate.t_s + h,
            position_lvlh_m=propagated_state[:3],
            velocity_lvlh_m_s=propagated_state[3:],
            q_eci_from_target_wxyz=q,
            omega_target_rad_s=w,
            joint_covariance=Phi @ estimate.joint_covariance @ Phi.T + Q,
        )

    def _thrust_effect(self, push: FloatArray, since_s: float, left_s: float) -> FloatArray:
        """Return the effect (6,), ``left_s`` later, of a constant acceleration that began ``since_s`` ago."""
        c, s = np.cos(self.n_rad_s * since_s), np.sin(self.n_rad_s * since_s)
        x, y, z = push.tolist()
        rotated_push = np.array([c * x + s * y, c * y - s * x, z])
        return np.asarray(transition_matrix(self.n_rad_s, left_s)[:, 3:] @ rotated_push)

    def _step_attitude(self, q: FloatArray, w: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Return attitude and rate after one step.

        The rate uses the classical Runge-Kutta method, and the attitude the mean rate (error h^3).
        """
        if self.inertia_kg_m2 is None:
            return quat_normalize(quat_multiply(q, quat_from_rotvec(w * h))), w

        def kinematics(q: FloatArray, w: FloatArray) -> FloatArray:
            return 0.5 * quat_multiply(q, np.array([0.0, *w]))

        k1, l1 = kinematics(q, w), self._euler(w)
        k2, l2 = kinematics(q + h / 2 * k1, w + h / 2 * l1), self._euler(w + h / 2 * l1)
        k3, l3 = kinematics(q + h / 2 * k2, w + h / 2 * l2), self._euler(w + h / 2 * l2)
        k4, l4 = kinematics(q + h * k3, w + h * l3), self._euler(w + h * l3)
        return (
            quat_normalize(q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)),
            w + h / 6 * (l1 + 2 * l2 + 2 * l3 + l4),
        )

    def _euler(self, w: FloatArray) -> FloatArray:
        """Return the angular acceleration of a free body [rad s-2]."""
        J = self.inertia_kg_m2
        assert J is not None  # noqa: S101 - not called for a constant rate
        return np.asarray(self._inverse_inertia @ -(skew(w) @ (J @ w)), float)

    @cached_property
    def _inverse_inertia(self) -> FloatArray:
        J = self.inertia_kg_m2
        assert J is not None  # noqa: S101 - not called for a constant rate
        return np.asarray(np.linalg.inv(J), float)

    def _attitude_transition(self, w: FloatArray, h: float) -> FloatArray:
        """Return the transition matrix (6, 6) of attitude and rate errors, with the rate constant over the step."""
        F = np.zeros((6, 6))
        F[:3, :3], F[:3, 3:] = -skew(w), np.eye(3)
        J = self.inertia_kg_m2
        if J is not None:
            F[3:, 3:] = self._inverse_inertia @ (skew(J @ w) - skew(w) @ J)
        term, total = np.eye(6), np.eye(6)
        for k in range(1, 5):
            term = term @ F * (h / k)
            total = total + term
        return total


def skew(v: FloatArray) -> FloatArray:
    """Return the cross-product matrix (3, 3) of ``v``."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def target_origin_offset_m(estimate: RelativeEstimate, com_target_m: FloatArray) -> FloatArray:
    """Return the model's origin minus the centre of mass (3,), GCRS axes [m]."""
    return -(matrix_from_quat(estimate.q_eci_from_target_wxyz) @ com_target_m)
