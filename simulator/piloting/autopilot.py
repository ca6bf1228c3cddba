"""Docking autopilot: flies the chaser by its translation switches, from the figures that a pilot sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2, COARSE_GAIN, FINE_GAIN, Demand
from flyaround.simulator.piloting.docking_figures import PROBE_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.piloting.control_laws import Switch
    from flyaround.simulator.piloting.docking_figures import DockingFigures, DockingLimits
    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.runtime.arrays import FloatArray

# The numbers below were chosen by eye: slow enough to look at, within `DockingLimits` and the chaser's thrust.

SWITCH_PAIRS: tuple[tuple[Switch, Switch], ...] = (("right", "left"), ("down", "up"), ("forward", "back"))
"""Switches of the positive and negative direction along each camera axis."""

FLYAROUND_ANGLE_DEG = 25.0
"""Angle off the axis above which the chaser first flies around the target [deg]."""

FLYAROUND_SPEED_M_S = 0.25  # speed around the target

FLYAROUND_CLEARANCE_M = 3.0
"""Clearance between the target's sphere and the chaser's docking point while flying around [m]."""

CONTACT_M_S = 0.08  # closing speed at contact

FINAL_APPROACH_M = 4.0
"""Distance to the port within which the chaser closes at `CONTACT_M_S` [m]."""

CLOSING_LIMIT_SHARE = 0.8
"""Share of the allowed closing speed that the autopilot uses."""

BRAKE_M_S2 = 0.012
"""Deceleration that the autopilot plans with, along and across the axis [m s-2]."""

# speed per distance, across and along the axis
ACROSS_GAIN_1_S, ALONG_GAIN_1_S = 0.12, 0.1
MAX_LATERAL_SPEED_M_S = 0.3  # largest speed across the axis

DEAD_BAND_M_S, DEAD_BAND_PER_M = 0.002, 5e-5
"""Dead band and its growth with the distance, which prevents chattering of the switches."""

COARSE_THRESHOLD_M_S = 0.3
"""Velocity error above which `COARSE_GAIN` applies [m s-1]."""


class Autopilot:
    """Guidance that flies the docking point to a distance from the port, or into it.

    Its inputs are the docking figures that a pilot sees, and its outputs are the pilot's switches. The attitude mode
    ``dock`` controls the attitude.

    Parameters
    ----------
    port : DockingPort
        Docking port of the target.
    target_radius_m : float
        Radius of the sphere about its centre of mass.
    limits : DockingLimits
        Docking limits to keep within.
    """

    def __init__(self, port: DockingPort, target_radius_m: float, limits: DockingLimits) -> None:
        R_port_from_target = matrix_from_quat(port.q_target_from_port_wxyz).T
        self._origin = R_port_from_target @ np.array(port.origin_m)
        self._round_m = target_radius_m + FLYAROUND_CLEARANCE_M + PROBE_M[2]
        self._limits = limits

    def demand(self, figures: DockingFigures, goal_m: float | None, held_s: float) -> Demand:
        """Return the demand for the next ``held_s`` seconds.

        Parameters
        ----------
        figures : DockingFigures
            Position and motion relative to the port.
        goal_m : float or None
            Distance in front of the port at which to come to rest, or None to dock.
        held_s : float
            Period of control.
        """
        f = figures
        velocity = np.array([f.right_m_s, f.down_m_s, f.closing_m_s])
        velocity_error = f.R_port_from_camera.T @ (self.demanded_velocity(f, goal_m) - velocity)
        max_step = float(np.abs(velocity_error).max())
        step, gain = ACCELERATION_M_S2 * held_s, 1.0
        if max_step < step:
            gain = FINE_GAIN
        elif max_step > COARSE_THRESHOLD_M_S:
            gain = COARSE_GAIN
        step *= gain
        # more than half a step, so that a pulse never makes the error larger
        dead_band = max(0.6 * step, DEAD_BAND_M_S + DEAD_BAND_PER_M * max(f.axial_m, 0.0))
        closed = [
            positive if x > 0 else negative
            for x, (positive, negative) in zip(velocity_error, SWITCH_PAIRS, strict=True)
            if abs(x) > dead_band
        ]
        return Demand(switches=frozenset(closed), gain=gain) if closed else Demand()

    def demanded_velocity(self, figures: DockingFigures, goal_m: float | None) -> FloatArray:
        """Return the commanded velocity (3,) along the port's axes: right, down, inward [m s-1]."""
        f = figures
        on_axis = f.lateral_m <= self._limits.lateral_m and f.axial_m > 0
        if f.off_axis_deg > FLYAROUND_ANGLE_DEG and not on_axis:
            return self._fly_around(f)
        offset = np.array([f.right_m, f.down_m])
        distance = float(np.linalg.norm(offset))
        across_m_s = min(
            ACROSS_GAIN_1_S * distance, float(np.sqrt(2 * BRAKE_M_S2 * distance)), MAX_LATERAL_SPEED_M_S
        )
        transverse = -offset * (across_m_s / max(distance, 1e-9))
        return np.array([*transverse, self._closing(f, goal_m)])

    def _closing(self, f: DockingFigures, goal_m: float | None) -> float:
        limits = self._limits
        remaining_m = f.axial_m - (goal_m or 0.0)
        allowed_m_s = CLOSING_LIMIT_SHARE * max(limits.closing_m_s, limits.closing_per_m * f.axial_m)
        if goal_m is None and f.axial_m < FINAL_APPROACH_M:
            speed = CONTACT_M_S if self._is_aligned(f) else 0.0
            # back off slowly if attitude error or offset are too large at this distance
            return speed if speed or f.axial_m > FINAL_APPROACH_M / 4 else -CONTACT_M_S / 2
        braking = float(np.sqrt(2 * BRAKE_M_S2 * abs(remaining_m)))
        if goal_m is None:
            braking = float(
                np.hypot(CONTACT_M_S, np.sqrt(2 * BRAKE_M_S2 * max(remaining_m - FINAL_APPROACH_M, 0.0)))
            )
            speed = min(allowed_m_s, braking)
        else:
            speed = float(np.sign(remaining_m)) * min(allowed_m_s, braking, ALONG_GAIN_1_S * abs(remaining_m))
        # converge on the port as fast as the offset allows: a funnel about the axis
        funnel = limits.lateral_m + 0.1 * max(f.axial_m, 0.0)
        return speed * float(np.clip(2.0 - f.lateral_m / funnel, 0.0, 1.0)) if speed > 0 else speed

    def _is_aligned(self, f: DockingFigures) -> bool:
        limits = self._limits
        attitude_error_deg = max(abs(f.roll_deg), abs(f.pitch_deg), abs(f.yaw_deg))
        # with a margin to the contact limits, which the final approach must keep
        return f.lateral_m < 0.5 * limits.lateral_m and attitude_error_deg < 0.7 * limits.attitude_deg

    def _fly_around(self, f: DockingFigures) -> FloatArray:
        """Return the velocity along a sphere around the target towards the axis."""
        p = np.array([f.right_m, f.down_m, -f.axial_m]) + self._origin
        distance = float(np.linalg.norm(p))
        out = p / distance
        towards = np.array([0.0, 0.0, -1.0]) - (-out[2]) * out
        if np.linalg.norm(towards) < 1e-3:  # opposite to the port any way round is equal
            towards = np.cross(out, [0.0, 1.0, 0.0])
        towards /= np.linalg.norm(towards)
        # never inward while flying around, and outward first if too near
        rise = self._round_m - distance
        outward = float(np.clip(ALONG_GAIN_1_S * rise, 0.0, FLYAROUND_SPEED_M_S))
        sideways = FLYAROUND_SPEED_M_S * float(np.clip(1.5 - max(rise, 0.0), 0.0, 1.0))
        return np.asarray(sideways * towards + outward * out)
