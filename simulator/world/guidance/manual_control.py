"""Manual control of the chaser: commands in six degrees of freedom, keep-out guard, predicted drift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Quat, Vec3, quat, vec3
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)
from flyaround.simulator.world.orbit.propagation import elements_from_state
from flyaround.simulator.world.relative.thrusted_step import relative_step
from flyaround.simulator.world.relative.yamanaka_ankersen import elliptic_transition_matrix

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.frames.lvlh import Lvlh
    from flyaround.simulator.world.guidance.keep_out import KeepOut
    from flyaround.simulator.world.orbit.propagation import OrbitTrack


@dataclass(frozen=True, kw_only=True)
class SteeringCommand:
    """The operator's command, held over one step.

    Parameters
    ----------
    acceleration_camera_m_s2 : tuple of float, optional
        Acceleration along camera axes (x right, y down, z forward).
    rate_camera_rad_s : tuple of float, optional
        Angular velocity relative to ECI, camera axes; attitude control follows it exactly.
    acceleration_lvlh_m_s2 : tuple of float, optional
        Acceleration along the target's LVLH axes (radial, along-track, cross-track), added to the other.
    """

    acceleration_camera_m_s2: Vec3 = (0.0, 0.0, 0.0)
    rate_camera_rad_s: Vec3 = (0.0, 0.0, 0.0)
    acceleration_lvlh_m_s2: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class ChaserState:
    """State of the chaser relative to the target.

    Parameters
    ----------
    t_s : float
        Time since the flight's start [s].
    position_eci_m : array
        Chaser minus the target's centre of mass, GCRS axes [m].
    velocity_eci_m_s : array
        Derivative of the same [m s-1].
    q_camera_from_eci_wxyz : array
        Attitude of the camera.
    omega_camera_rad_s : array, optional
        Camera's angular velocity relative to ECI, camera axes.
    """

    t_s: float
    position_eci_m: Vec3
    velocity_eci_m_s: Vec3
    q_camera_from_eci_wxyz: Quat
    omega_camera_rad_s: Vec3 = (0.0, 0.0, 0.0)


def step(state: ChaserState, command: SteeringCommand, dt_s: float, orbit: OrbitTrack) -> ChaserState:
    """Advance the chaser by one step: a Runge-Kutta step of its translation, and the exact rotation.

    For steps of 0.1 s the truncation error is far below a micrometre.

    Parameters
    ----------
    state : ChaserState
        State at the start of the step.
    command : SteeringCommand
        Command of the step.
    dt_s : float
        Step [s], positive.
    orbit : OrbitTrack
        The target's track, for the difference of gravity.

    Returns
    -------
    ChaserState
        State at the end of the step.
    """
    omega = np.array(command.rate_camera_rad_s, float)
    acceleration_camera = np.array(command.acceleration_camera_m_s2, float)
    R0_eci_from_camera = matrix_from_quat(state.q_camera_from_eci_wxyz).T
    is_rotating = bool(omega.any() and acceleration_camera.any())
    lvlh_acceleration = np.zeros(3)
    if any(command.acceleration_lvlh_m_s2):
        # along the LVLH axes at the middle of the step, which rotate by 0.1 mrad per step
        lvlh_acceleration = orbit.frame(state.t_s + dt_s / 2).R_eci_from_lvlh @ np.array(
            command.acceleration_lvlh_m_s2
        )

    def thrust(tau: float) -> list[float]:
        rotated = (
            matrix_from_quat(quat_from_rotvec(omega * tau)) @ acceleration_camera
            if is_rotating
            else acceleration_camera
        )
        return [float(x) for x in R0_eci_from_camera @ rotated + lvlh_acceleration]

    step_s = dt_s
    p, v = relative_step(
        orbit, state.t_s, step_s, (np.array(state.position_eci_m), np.array(state.velocity_eci_m_s)), thrust
    )
    q = quat_multiply(quat_conjugate(quat_from_rotvec(omega * step_s)), state.q_camera_from_eci_wxyz)
    return replace(
        state,
        t_s=state.t_s + step_s,
        position_eci_m=vec3(p),
        velocity_eci_m_s=vec3(v),
        q_camera_from_eci_wxyz=quat(quat_normalize(q)),
        omega_camera_rad_s=vec3(omega),
    )


def guarded_command(
    state: ChaserState,
    command: SteeringCommand,
    dt_s: float,
    frame: Lvlh,
    keep_out: KeepOut,
    brake_m_s2: float,
    corridor_frame: Lvlh | None = None,
) -> tuple[SteeringCommand, bool]:
    """Limit a command by the keep-out sphere; see `KeepOut.guard`.

    Parameters
    ----------
    state : ChaserState
        State at the start of the step.
    command : SteeringCommand
        Command of the step.
    dt_s : float
        Length of the step [s].
    frame : Lvlh
        The target's present LVLH frame.
    keep_out : KeepOut
        Sphere around the target.
    brake_m_s2 : float
        Available deceleration.
    corridor_frame : Lvlh, optional
        Rotating frame in which the corridor's axis is given; by default ``frame``.

    Returns
    -------
    tuple
        Allowed command, and True if it differs from the given one.
    """
    axes = frame if corridor_frame is None else corridor_frame
    p, v = axes.from_eci(np.array(state.position_eci_m), np.array(state.velocity_eci_m_s))
    R_axes_from_camera = axes.R_eci_from_lvlh.T @ matrix_from_quat(state.q_camera_from_eci_wxyz).T
    R_axes_from_lvlh = axes.R_eci_from_lvlh.T @ frame.R_eci_from_lvlh
    requested = R_axes_from_camera @ np.array(command.acceleration_camera_m_s2)
    requested = requested + R_axes_from_lvlh @ np.array(command.acceleration_lvlh_m_s2)
    allowed, overruled = keep_out.guard(p, v, requested, dt_s, brake_m_s2)
    if not overruled:
        return command, False
    return replace(
        command,
        acceleration_camera_m_s2=(0.0, 0.0, 0.0),
        acceleration_lvlh_m_s2=vec3(R_axes_from_lvlh.T @ allowed),
    ), True


def predicted_drift_lvlh_m(
    orbit: OrbitTrack, chaser: ChaserState, horizon_s: float, samples: int = 25
) -> FloatArray:
    """Predict the chaser's free flight, to first order in its distance from the target.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the target.
    chaser : ChaserState
        Present state.
    horizon_s : float
        Length of the prediction.
    samples : int, optional
        Number of points.

    Returns
    -------
    (samples, 3) array
        Positions in LVLH [m], at even intervals from now to ``horizon_s``.
    """
    mu = orbit.forces.mu_m3_s2
    elements = elements_from_state(*orbit(chaser.t_s), mu)
    frame = orbit.frame(chaser.t_s)
    state = np.concatenate(frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)))
    times = np.linspace(0.0, horizon_s, samples)
    return np.array([(elliptic_transition_matrix(elements, float(t), mu) @ state)[:3] for t in times])
