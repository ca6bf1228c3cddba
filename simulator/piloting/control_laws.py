"""Control laws: demands of thrust and turn, rate slew, brake, and keeping the target in view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
)
from flyaround.simulator.world.guidance.manual_control import ChaserState, SteeringCommand

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.frames.lvlh import Lvlh

Switch = str
"""Name of an on-off controller, one of `SWITCHES`."""

# Thrust directions in camera axes: x right, y down, z forward.
THRUST: dict[Switch, Vec3] = {
    "forward": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "up": (0.0, -1.0, 0.0),
    "down": (0.0, 1.0, 0.0),
}
# Right-handed camera rotations: about +x the boresight moves up, about +y it moves right.
TURN: dict[Switch, Vec3] = {
    "pitch-up": (1.0, 0.0, 0.0),
    "pitch-down": (-1.0, 0.0, 0.0),
    "yaw-left": (0.0, -1.0, 0.0),
    "yaw-right": (0.0, 1.0, 0.0),
    "roll-left": (0.0, 0.0, -1.0),
    "roll-right": (0.0, 0.0, 1.0),
}
SWITCHES: tuple[Switch, ...] = (*THRUST, *TURN)
NO_DEMAND: Vec3 = (0.0, 0.0, 0.0)  # no demand along any axis

ACCELERATION_M_S2 = 0.05
"""Full thrust per mass: two seconds of it give 0.1 m/s, the speed of an inspection [m s-2]."""

RATE_RAD_S = np.radians(2.0)  # full rate of a rotation

SLEW_RAD_S2 = np.radians(10.0)
"""Slew acceleration of the attitude control [rad s-2], which keeps images from jerking."""

BRAKE_M_S2 = 0.1  # largest deceleration of the brake
TRACK_GAIN_1_S = 1.0  # rate per angle of the attitude error
COARSE_GAIN, FINE_GAIN = 5.0, 0.2  # factors of a demand with the modifiers

PULSE_M_S = 0.01
"""Delta-v of one pulse."""

PULSE_RAD = np.radians(0.2)
"""Rotation of one pulse [rad]."""

PULSE_RAD_S = np.radians(0.2)
"""Rate of a rotation by pulses, reached in one step [rad s-1]."""

RATE_TIME_S = 1.0
"""Time in which a rotation reaches the demanded rate in rate-hold mode [s]."""

MAX_ALIGN_RATE_RAD_S = np.radians(5.0)
"""Largest rate on the way to the docked attitude [rad s-1]."""

AT_REST_M_S = 1e-6  # speed below which the brake gives no thrust

BRAKE_RELEASE_M_S = 1e-4
"""Speed below which the brake releases [m s-1]."""


@dataclass(frozen=True, kw_only=True)
class Demand:
    """Manual demand of thrust and rotation.

    Parameters
    ----------
    thrust : tuple of float
        Thrust right, down and forward, each -1 to 1 of `ACCELERATION_M_S2`.
    turn : tuple of float
        Rotation up, right and clockwise, each -1 to 1 of `RATE_RAD_S`.
    switches : frozenset of str
        Closed on-off controllers, each for full thrust or rotation in its direction. In pulse mode each gives one pulse
        when it closes.
    gain : float
        Factor of all of these, at most `COARSE_GAIN`.

    Raises
    ------
    ValueError
        If a value is out of range, or a switch does not exist.
    """

    thrust: Vec3 = NO_DEMAND
    turn: Vec3 = NO_DEMAND
    switches: frozenset[Switch] = frozenset()
    gain: float = 1.0

    def __post_init__(self) -> None:
        for axes in (self.thrust, self.turn):
            if len(axes) != 3 or not all(-1.0 <= share <= 1.0 for share in axes):
                raise ValueError(f"a demand of {axes} must be three numbers from -1 to 1")
        if not 0.0 < self.gain <= COARSE_GAIN or not self.switches <= set(SWITCHES):
            raise ValueError(f"gain {self.gain} or one of {sorted(self.switches)} cannot be demanded")

    @property
    def pushes(self) -> bool:
        """True if thrust is demanded."""
        return any(switch in THRUST for switch in self.switches) or any(self.thrust)

    @property
    def idle(self) -> bool:
        """True if neither thrust nor rotation is demanded."""
        return not self.switches and not any(self.thrust) and not any(self.turn)

    def switched_thrust_m_s2(self) -> FloatArray:
        """Return the (3,) acceleration that the switches demand, camera axes [m s-2]."""
        return ACCELERATION_M_S2 * self.gain * direction(THRUST, self.switches)

    def switched_turn_rad_s(self) -> FloatArray:
        """Return the (3,) rate relative to ECI that the switches demand, camera axes [rad s-1]."""
        return RATE_RAD_S * self.gain * direction(TURN, self.switches)


def tracking_rate_rad_s(chaser: ChaserState, aim_camera: Vec3, dt_s: float) -> FloatArray:
    """Return the rate that keeps the target in a direction of the camera frame [rad s-1].

    The rate of the line of sight, plus a rotation that reduces the error.

    Parameters
    ----------
    chaser : ChaserState
        Present state.
    aim_camera : array
        Unit vector, camera frame, at which the target should appear.
    dt_s : float
        Duration of the rate.
    """
    R_camera_from_eci = matrix_from_quat(chaser.q_camera_from_eci_wxyz)
    los = -R_camera_from_eci @ np.array(chaser.position_eci_m)
    los_rate = -R_camera_from_eci @ np.array(chaser.velocity_eci_m_s)
    distance = float(np.linalg.norm(los))
    direction_eci = los / distance
    # in a long step, correct at most the error itself
    gain_1_s = min(TRACK_GAIN_1_S, 1 / dt_s)
    return np.cross(direction_eci, los_rate) / distance + gain_1_s * np.cross(
        np.array(aim_camera), direction_eci
    )


def docked_rate_rad_s(
    chaser: ChaserState, attitude: tuple[FloatArray, FloatArray], port: DockingPort, dt_s: float
) -> FloatArray:
    """Return the rate that reaches and keeps the attitude of a docked chaser [rad s-1].

    Parameters
    ----------
    chaser : ChaserState
        Present state.
    attitude : tuple of array
        Attitude of the target: ``q_eci_from_target_wxyz`` and angular velocity, target axes.
    port : DockingPort
        Docking port of the target.
    dt_s : float
        Duration of the rate.
    """
    q_target, omega = attitude
    q_camera_from_target = quat_multiply(chaser.q_camera_from_eci_wxyz, q_target)
    error_wxyz = quat_multiply(
        quat_conjugate(port.q_target_from_port_wxyz), quat_conjugate(q_camera_from_target)
    )
    sine, cosine = float(np.linalg.norm(error_wxyz[1:])), float(error_wxyz[0])
    angle = 2 * np.arctan2(sine, abs(cosine))
    axis = error_wxyz[1:] / max(sine, 1e-12) * (1.0 if cosine >= 0 else -1.0)
    back = min(min(TRACK_GAIN_1_S, 1 / dt_s) * angle, MAX_ALIGN_RATE_RAD_S)
    return matrix_from_quat(q_camera_from_target) @ omega - back * axis


def rotated_aim(aim_camera: Vec3, rate_camera_rad_s: FloatArray, dt_s: float) -> Vec3:
    """Return a direction in the camera frame after rotation at a rate for ``dt_s``."""
    turn = matrix_from_quat(quat_from_rotvec(-np.asarray(rate_camera_rad_s) * dt_s))
    return vec3(turn @ np.array(aim_camera))


def brake_camera_m_s2(chaser: ChaserState, frame: Lvlh, dt_s: float) -> tuple[FloatArray, float]:
    """Return the bounded acceleration that brings the chaser to rest in LVLH, and the remaining speed [m s-1]."""
    _, v_lvlh = frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s))
    v_camera = matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ frame.R_eci_from_lvlh @ v_lvlh
    speed = float(np.linalg.norm(v_camera))
    if speed < AT_REST_M_S:
        return np.zeros(3), speed
    return -v_camera / speed * min(BRAKE_M_S2, speed / dt_s), speed


def slewed_command(
    acceleration: FloatArray, wanted_rate: FloatArray, chaser: ChaserState, dt_s: float
) -> SteeringCommand:
    """Return the command of one step, with the rate slewed towards ``wanted_rate``."""
    change = wanted_rate - np.array(chaser.omega_camera_rad_s)
    size = float(np.linalg.norm(change))
    max_change = SLEW_RAD_S2 * dt_s
    if size > max_change:
        change = change * (max_change / size)
    return SteeringCommand(
        acceleration_camera_m_s2=vec3(acceleration),
        rate_camera_rad_s=vec3(np.array(chaser.omega_camera_rad_s) + change),
    )


def direction(directions: dict[Switch, Vec3], switches: AbstractSet[Switch]) -> FloatArray:
    """Return the (3,) sum of the directions of the closed switches."""
    return np.sum([directions[s] for s in directions if s in switches] or [NO_DEMAND], axis=0)
