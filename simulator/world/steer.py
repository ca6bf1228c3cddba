"""A chaser under manual control: six degrees of freedom, commanded in camera axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.arrays import Quat, Vec3, quat, vec3
from simulator.world.relative_motion import relative_step
from simulator.world.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)

if TYPE_CHECKING:
    from simulator.world.orbit import OrbitTrack


@dataclass(frozen=True, kw_only=True)
class Command:
    """What the operator asks for, held over one step.

    Parameters
    ----------
    acceleration_camera_m_s2 : thrust per mass along camera axes (x right, y down, z forward).
    rate_camera_rad_s : angular rate relative to ECI about camera axes; attitude control follows it exactly.
    """

    acceleration_camera_m_s2: Vec3 = (0.0, 0.0, 0.0)
    rate_camera_rad_s: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class ChaserState:
    """The chaser beside the target at ``t_s``.

    Parameters
    ----------
    position_eci_m, velocity_eci_m_s : chaser minus target's centre of mass, along GCRS axes.
    q_camera_from_eci_wxyz : attitude of the camera.
    omega_camera_rad_s : its rate relative to ECI, camera axes.
    """

    t_s: float
    position_eci_m: Vec3
    velocity_eci_m_s: Vec3
    q_camera_from_eci_wxyz: Quat
    omega_camera_rad_s: Vec3 = (0.0, 0.0, 0.0)


def step(state: ChaserState, command: Command, dt_s: float, orbit: OrbitTrack) -> ChaserState:
    """The state ``dt_s`` later: one Runge-Kutta step of translation, attitude by the exact rotation.

    At steps of a tenth of a second the truncation error is far below a micrometre.

    Parameters
    ----------
    state : where the chaser is.
    command : held over the step.
    dt_s : step [s], positive.
    orbit : the target's track, for the difference of gravity.
    """
    omega = np.array(command.rate_camera_rad_s, float)
    push = np.array(command.acceleration_camera_m_s2, float)
    R0_eci_from_camera = matrix_from_quat(state.q_camera_from_eci_wxyz).T
    turning = bool(omega.any() and push.any())

    def thrust(tau: float) -> list[float]:
        turned = matrix_from_quat(quat_from_rotvec(omega * tau)) @ push if turning else push
        return [float(x) for x in R0_eci_from_camera @ turned]

    h = dt_s
    p, v = relative_step(
        orbit, state.t_s, h, (np.array(state.position_eci_m), np.array(state.velocity_eci_m_s)), thrust
    )
    q = quat_multiply(quat_conjugate(quat_from_rotvec(omega * h)), state.q_camera_from_eci_wxyz)
    return replace(
        state,
        t_s=state.t_s + h,
        position_eci_m=vec3(p),
        velocity_eci_m_s=vec3(v),
        q_camera_from_eci_wxyz=quat(quat_normalize(q)),
        omega_camera_rad_s=vec3(omega),
    )
