"""Reaction wheels of the chaser: attitude controller, limits of torque and momentum, rigid-body dynamics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.sections import Degrees, Inertia, Section
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)
from flyaround.simulator.world.frames.vectors import cross_product
from flyaround.simulator.world.time.steps import step_count

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray

    Reference = Callable[[float], tuple[FloatArray, FloatArray]]


class Wheels(Section, frozen=True, kw_only=True):
    """Reaction wheels that rotate the camera, within their limits.

    Three wheels along the camera's axes (right, down, forward). ``start_error_deg`` is the initial attitude error.
    """

    # principal moments of inertia about the camera's axes
    inertia_kg_m2: tuple[Inertia, Inertia, Inertia] = (20.0, 20.0, 20.0)
    # limits of each wheel; a saturated wheel gives no more torque in that direction
    torque_nm: Annotated[float, Meta(gt=0, le=1e3)] = 0.05
    momentum_nms: Annotated[float, Meta(gt=0, le=1e4)] = 4.0
    # closed-loop bandwidth of the attitude controller
    bandwidth_rad_s: Annotated[float, Meta(gt=0, le=10)] = 0.2
    damping: Annotated[float, Meta(gt=0, le=5)] = 0.9
    # control period; the torque is held over it
    period_s: Annotated[float, Meta(ge=0.01, le=10)] = 0.25
    start_error_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class WheelTrack:
    """The chaser's attitude over a flight, as controlled by its wheels.

    Parameters
    ----------
    wheels : Wheels
        Wheels of the chaser.
    q_eci_from_camera_wxyz : (n, 4) array
        Attitude at the start of each period.
    omega_rad_s : (n, 3) array
        Angular velocity at the start of each period, camera axes.
    momentum_nms : (n, 3) array
        Momentum of the wheels at the start of each period, camera axes.
    torque_nm : (n, 3) array
        Torque on the body in each period, camera axes.
    error_rad : (n,) array
        Angle between attitude and reference.
    """

    wheels: Wheels
    q_eci_from_camera_wxyz: FloatArray
    omega_rad_s: FloatArray
    momentum_nms: FloatArray
    torque_nm: FloatArray
    error_rad: FloatArray

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_camera_from_eci_wxyz`` and the rate relative to ECI, camera axes [rad s-1]."""
        h = self.wheels.period_s
        k = min(max(int(t_s // h), 0), len(self.error_rad) - 1)
        q, omega, _ = wheel_step(
            self.wheels,
            (self.q_eci_from_camera_wxyz[k], self.omega_rad_s[k], self.momentum_nms[k]),
            self.torque_nm[k],
            t_s - k * h,
        )
        return quat_conjugate(q), omega


def fly_wheels(reference: Reference, duration_s: float, wheels: Wheels) -> WheelTrack:
    """Simulate wheels that follow a reference attitude.

    The commanded torque of each period is the sum of a feed-forward of the reference's acceleration, the gyroscopic
    torque of body and wheels, and a PD law on the attitude error. It is clipped to the wheels' limits of torque and
    momentum.

    Parameters
    ----------
    reference : Reference
        Function of time [s]: ``q_camera_from_eci_wxyz`` and angular velocity in camera axes [rad s-1].
    duration_s : float
        Length of the flight.
    wheels : Wheels
        Wheels of the chaser.

    References
    ----------
    Wie (2008), Space Vehicle Dynamics and Control, sec. 7.3 (quaternion feedback with gyroscopic decoupling).
    """
    J, h = np.array(wheels.inertia_kg_m2), wheels.period_s
    spring, damper = wheels.bandwidth_rad_s**2, 2 * wheels.damping * wheels.bandwidth_rad_s
    reference_q, reference_rate = reference(0.0)
    q = quat_multiply(quat_conjugate(reference_q), quat_from_rotvec(np.radians(wheels.start_error_deg)))
    omega, momentum = reference_rate, np.zeros(3)
    rows = []
    for k in range(step_count(duration_s, h)):
        next_q, next_rate = reference(min((k + 1) * h, duration_s))
        # reference relative to the present attitude, by the shorter rotation
        error_q = quat_multiply(quat_conjugate(q), quat_conjugate(reference_q))
        error_q = error_q if error_q[0] >= 0 else -error_q
        angle = 2 * float(np.arctan2(np.linalg.norm(error_q[1:]), error_q[0]))
        R = matrix_from_quat(error_q)
        acceleration = (next_rate - reference_rate) / h
        command = J * (R @ acceleration + spring * 2 * error_q[1:] + damper * (R @ reference_rate - omega))
        command = command + np.array(cross_product(omega.tolist(), (J * omega + momentum).tolist()))
        torque = np.clip(command, -wheels.torque_nm, wheels.torque_nm)
        limit = wheels.momentum_nms
        torque = np.clip(torque, (momentum - limit) / h, (momentum + limit) / h)
        rows.append(np.concatenate([q, omega, momentum, torque, [angle]]))
        q, omega, momentum = wheel_step(wheels, (q, omega, momentum), torque, h)
        reference_q, reference_rate = next_q, next_rate
    table = np.array(rows)
    return WheelTrack(
        wheels=wheels,
        q_eci_from_camera_wxyz=table[:, :4],
        omega_rad_s=table[:, 4:7],
        momentum_nms=table[:, 7:10],
        torque_nm=table[:, 10:13],
        error_rad=table[:, 13],
    )


def wheel_step(
    wheels: Wheels, state: tuple[FloatArray, FloatArray, FloatArray], torque_nm: FloatArray, h: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Advance attitude, rate and wheel momentum by ``h`` seconds under a constant torque.

    Parameters
    ----------
    wheels : Wheels
        Wheels of the chaser.
    state : tuple of array
        ``q_eci_from_camera_wxyz`` (4,), angular velocity (3,) [rad s-1] and wheel momentum (3,) [N m s], camera axes.
    torque_nm : (3,) array
        Torque on the body, camera axes.
    h : float
        Step [s]; one classical Runge-Kutta step.
    """
    q, omega, momentum = state
    if h == 0.0:
        return state
    ix, iy, iz = wheels.inertia_kg_m2
    ux, uy, uz = torque_nm.tolist()
    mx, my, mz = momentum.tolist()

    def rate(y: list[float], tau: float) -> list[float]:
        w, x, y_, z, a, b, c = y
        # the wheels take momentum from the body
        total = (ix * a + mx - ux * tau, iy * b + my - uy * tau, iz * c + mz - uz * tau)
        gx, gy, gz = cross_product((a, b, c), total)
        return [
            0.5 * (-x * a - y_ * b - z * c),
            0.5 * (w * a + y_ * c - z * b),
            0.5 * (w * b + z * a - x * c),
            0.5 * (w * c + x * b - y_ * a),
            (ux - gx) / ix,
            (uy - gy) / iy,
            (uz - gz) / iz,
        ]

    def plus(a: list[float], s: float, b: list[float]) -> list[float]:
        return [u + s * v for u, v in zip(a, b, strict=True)]

    y = [*q.tolist(), *omega.tolist()]
    k1 = rate(y, 0.0)
    k2 = rate(plus(y, h / 2, k1), h / 2)
    k3 = rate(plus(y, h / 2, k2), h / 2)
    k4 = rate(plus(y, h, k3), h)
    end = np.array(y) + h / 6 * (np.array(k1) + 2 * np.array(k2) + 2 * np.array(k3) + np.array(k4))
    return quat_normalize(end[:4]), end[4:], momentum - torque_nm * h
