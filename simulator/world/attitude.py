"""Rigid-body attitude: Euler's equations and quaternion kinematics, propagated without torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

from simulator.world.rotation import quat_normalize

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.integrate import OdeSolution

    from simulator.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class AttitudeTrack:
    """A propagated tumble over ``0 <= t <= duration_s``."""

    duration_s: float
    solution: OdeSolution

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """``q_eci_from_body_wxyz`` (unit: the interpolant is renormalised) and the body rate [rad s-1]."""
        y = self.solution(t_s)
        return quat_normalize(y[:4]), y[4:]


def propagate_attitude(
    q_eci_from_body_wxyz: ArrayLike, omega_body_rad_s: ArrayLike, inertia_kg_m2: ArrayLike, duration_s: float
) -> AttitudeTrack:
    """Torque-free tumble of a rigid body.

    Parameters
    ----------
    q_eci_from_body_wxyz : (4,) attitude at t = 0.
    omega_body_rad_s : (3,) rate relative to ECI, body axes.
    inertia_kg_m2 : (3, 3) about the centre of mass, body axes.
    duration_s : span [s].

    Raises
    ------
    ValueError
        If the inertia is not symmetric and positive definite.

    References
    ----------
    Wertz (1978), Spacecraft Attitude Determination and Control, eq. 16-2 and 16-53.
    """
    J = np.asarray(inertia_kg_m2, float)
    check_inertia(J)
    J_inverse = np.linalg.inv(J)
    y0 = np.concatenate([quat_normalize(q_eci_from_body_wxyz), np.asarray(omega_body_rad_s, float)])
    # a step turns the body by half a radian at most, which keeps the interpolant as good as the steps
    rate = float(np.linalg.norm(y0[4:]))
    max_step = 0.5 / rate if rate > 1e-6 else np.inf

    def derivative(_t: float, y: FloatArray) -> FloatArray:
        qw, qx, qy, qz, a, b, c = y.tolist()
        L = J @ y[4:]
        la, lb, lc = L.tolist()
        alpha = J_inverse @ np.array([lb * c - lc * b, lc * a - la * c, la * b - lb * a])
        return np.array(
            [
                0.5 * (-qx * a - qy * b - qz * c),
                0.5 * (qw * a + qy * c - qz * b),
                0.5 * (qw * b + qz * a - qx * c),
                0.5 * (qw * c + qx * b - qy * a),
                *alpha,
            ]
        )

    result = solve_ivp(
        derivative,
        (0.0, duration_s),
        y0,
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        max_step=max_step,
        dense_output=True,
    )
    if not result.success or result.sol is None:
        raise ValueError(f"the attitude could not be propagated over {duration_s} s: {result.message}")
    return AttitudeTrack(duration_s, result.sol)


def check_inertia(inertia_kg_m2: FloatArray) -> None:
    """Refuse a matrix that no rigid body can have.

    Raises
    ------
    ValueError
        If it is not symmetric, not positive definite, or breaks the triangle inequality.
    """
    if inertia_kg_m2.shape != (3, 3) or not np.allclose(
        inertia_kg_m2, inertia_kg_m2.T, rtol=1e-9, atol=1e-12
    ):
        raise ValueError("the inertia must be a symmetric 3x3 matrix")
    low, middle, high = np.linalg.eigvalsh(inertia_kg_m2)
    if low <= 0:
        raise ValueError(f"the inertia must be positive definite, its smallest principal moment is {low:g}")
    if low + middle < high * (1 - 1e-9):
        raise ValueError(
            f"no rigid body has principal moments {low:g}, {middle:g}, {high:g}: the two smaller must add up "
            "to at least the largest"
        )
