"""Rigid-body attitude: Euler's equations and quaternion kinematics, free or under torque."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_normalize
from flyaround.simulator.world.orbit.dense_output import DenseOutput, check_span, integrate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


Torque = Callable[[float, FloatArray], FloatArray]


class AttitudeTrack(Protocol):
    """The attitude of a body over a flight: propagated, prescribed or recorded."""

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` (unit) and the body's rate relative to ECI, body axes [rad s-1]."""
        ...


@dataclass(frozen=True, eq=False)
class RigidBodyTrack:
    """A propagated tumble over ``0 <= t <= duration_s``.

    Parameters
    ----------
    duration_s : float
        Span [s].
    solution : DenseOutput
        (7,) attitude and angular momentum along ECI axes, over time.
    inertia_kg_m2 : (3, 3) array
        Inertia, body axes.
    inverse_inertia : (3, 3) array
        Its inverse [kg-1 m-2].
    """

    duration_s: float
    solution: DenseOutput
    inertia_kg_m2: FloatArray
    inverse_inertia: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` (unit: the interpolant is renormalised) and the body rate [rad s-1]."""
        y = self.solution(t_s)
        q = y[:4] / math.sqrt(float(y[:4] @ y[:4]))
        return q, self.inverse_inertia @ (y[4:] @ matrix_from_quat(q))


def propagate_attitude(
    q_eci_from_body_wxyz: ArrayLike,
    omega_body_rad_s: ArrayLike,
    inertia_kg_m2: ArrayLike,
    duration_s: float,
    torque: Torque | None = None,
) -> RigidBodyTrack:
    """Propagate the tumble of a rigid body.

    The state is the attitude and the angular momentum along inertial axes, which is exactly constant without torque.

    Parameters
    ----------
    q_eci_from_body_wxyz : array_like
        (4,) attitude at t = 0.
    omega_body_rad_s : array_like
        (3,) rate relative to ECI, body axes.
    inertia_kg_m2 : array_like
        (3, 3) about the centre of mass, body axes.
    duration_s : float
        Span [s].
    torque : Torque, optional
        Torque on the body, body axes [N m], as a function of time [s] and ``R_eci_from_body``; by default none.

    Returns
    -------
    RigidBodyTrack
        Attitude and rate [rad s-1] over the span.

    Raises
    ------
    ValueError
        If the inertia is not symmetric and positive definite, the span is negative, or a number is not finite.

    References
    ----------
    Wertz (1978), Spacecraft Attitude Determination and Control, chapter 16 (kinematics and Euler's equations).
    """
    check_span(duration_s)
    J = np.asarray(inertia_kg_m2, float)
    check_inertia(J)
    J_inverse = np.linalg.inv(J)
    q0, w0 = quat_normalize(q_eci_from_body_wxyz), np.asarray(omega_body_rad_s, float)
    momentum = matrix_from_quat(q0) @ (J @ w0)
    # a step rotates the body by at most 0.2 rad, so that the interpolant is as accurate as the steps (1e-14); under a
    # torque, which is slower and less accurate, by twice that (1e-12)
    rate = float(np.linalg.norm(w0))
    # slower than 1e-6 rad/s, a day turns the body by less than 0.1 rad
    max_step = (0.2 if torque is None else 0.4) / rate if rate > 1e-6 else np.inf
    if torque is not None:
        # a torque may rotate a body at rest: a minute bounds the interpolation error
        max_step = min(max_step, 60.0)
    ((a00, a01, a02), (a10, a11, a12), (a20, a21, a22)) = J_inverse.tolist()

    def derivative(t: float, y: FloatArray) -> FloatArray:
        w, x, y_, z, lx, ly, lz = y.tolist()
        s = 2 / (w * w + x * x + y_ * y_ + z * z)
        # angular momentum in the body: R_body_from_eci L
        bx = lx - s * ((y_ * y_ + z * z) * lx - (x * y_ + w * z) * ly - (x * z - w * y_) * lz)
        by = ly - s * ((x * x + z * z) * ly - (x * y_ - w * z) * lx - (y_ * z + w * x) * lz)
        bz = lz - s * ((x * x + y_ * y_) * lz - (x * z + w * y_) * lx - (y_ * z - w * x) * ly)
        a = a00 * bx + a01 * by + a02 * bz
        b = a10 * bx + a11 * by + a12 * bz
        c = a20 * bx + a21 * by + a22 * bz
        push: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0)
        if torque is not None:
            R = matrix_from_quat(y[:4] * math.sqrt(s / 2))
            push = R @ torque(t, R)
        return np.array(
            [
                0.5 * (-x * a - y_ * b - z * c),
                0.5 * (w * a + y_ * c - z * b),
                0.5 * (w * b + z * a - x * c),
                0.5 * (w * c + x * b - y_ * a),
                *push,
            ]
        )

    solution = integrate(
        derivative,
        np.concatenate([q0, momentum]),
        (0.0, duration_s),
        rtol=1e-13,
        atol=np.array([1e-14] * 4 + [1e-14 * max(float(np.linalg.norm(momentum)), 1e-6)] * 3),
        max_step_s=max_step,
    )
    return RigidBodyTrack(duration_s, solution, J, J_inverse)


def check_inertia(inertia_kg_m2: FloatArray) -> None:
    """Raise if no rigid body can have this inertia.

    Raises
    ------
    ValueError
        If it is not finite, not symmetric within 1e-9 of its largest element, not positive definite, or breaks the
        triangle inequality.
    """
    if not np.isfinite(inertia_kg_m2).all():
        raise ValueError("the inertia is not finite")
    rounding = 1e-9 * float(np.abs(inertia_kg_m2).max(initial=0.0))
    if inertia_kg_m2.shape != (3, 3) or np.abs(inertia_kg_m2 - inertia_kg_m2.T).max() > rounding:
        raise ValueError("the inertia must be a symmetric 3x3 matrix")
    low, middle, high = np.linalg.eigvalsh(inertia_kg_m2)
    if low <= 0:
        raise ValueError(f"the inertia must be positive definite, its smallest principal moment is {low:g}")
    if low + middle < high * (1 - 1e-9):
        raise ValueError(
            f"no rigid body has principal moments {low:g}, {middle:g}, {high:g}: the two smaller must add up "
            "to at least the largest"
        )
