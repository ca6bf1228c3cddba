"""A pilot that docks by the keys of translation alone: reads the docking figures, says which keys to hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2, COARSE, COARSE_GAIN, FINE, FINE_GAIN
from flyaround.simulator.piloting.docking_figures import PROBE_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_figures import DockingFigures, DockingLimits
    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.runtime.arrays import FloatArray

PUSHES = (("steer.right", "steer.left"), ("steer.down", "steer.up"), ("steer.forward", "steer.back"))
"""Along each camera axis: the command of the positive and of the negative direction."""

ROUND_ABOVE_DEG = 25.0
"""Farther off the axis than this the chaser goes round the target first."""
ROUND_M_S = 0.25
CLEAR_M = 3.0
"""Between the target's sphere and the chaser's docking point on the way round."""
CONTACT_M_S = 0.08
SLOW_WITHIN_M = 4.0
"""From here to the port the chaser closes at `CONTACT_M_S`."""
LIMIT_SHARE = 0.8
"""Of the closing speed that is allowed at a distance."""
BRAKE_M_S2 = 0.012
"""Deceleration that the pilot plans with, along the axis and across it."""
ACROSS_GAIN_1_S, ALONG_GAIN_1_S = 0.12, 0.1
ACROSS_M_S = 0.3
DEAD_M_S, DEAD_PER_M = 0.002, 5e-5
"""What is missing below this, and so much more for each metre of distance, is let be: keys that chatter cost most."""
COARSE_ABOVE_M_S = 0.3
"""What is missing beyond this is given coarsely."""


class Autopilot:
    """Flies the docking point to a distance before the port, or into it.

    It sees what the operator sees, the docking figures, and holds the keys that an operator holds. The attitude it
    leaves to the mode that keeps the docked one.

    Parameters
    ----------
    port : of the target. target_radius_m : of the sphere about its centre of mass.
    limits : whose figures it keeps.
    """

    def __init__(self, port: DockingPort, target_radius_m: float, limits: DockingLimits) -> None:
        R_port_from_target = matrix_from_quat(port.q_target_from_port_wxyz).T
        self._origin = R_port_from_target @ np.array(port.origin_m)
        self._round_m = target_radius_m + CLEAR_M + PROBE_M[2]
        self._limits = limits

    def keys(self, figures: DockingFigures, goal_m: float | None, held_s: float) -> frozenset[str]:
        """The held commands for the next ``held_s``.

        Parameters
        ----------
        figures : now. goal_m : distance before the port to come to rest at, or None to dock.
        """
        f = figures
        velocity = np.array([f.right_m_s, f.down_m_s, f.closing_m_s])
        missing = f.R_port_from_camera.T @ (self.wanted_velocity(f, goal_m) - velocity)
        most = float(np.abs(missing).max())
        step = ACCELERATION_M_S2 * held_s
        gain: tuple[str, ...] = ()
        if most < step:
            gain, step = (FINE,), step * FINE_GAIN
        elif most > COARSE_ABOVE_M_S:
            gain, step = (COARSE,), step * COARSE_GAIN
        least = max(0.6 * step, DEAD_M_S + DEAD_PER_M * max(f.axial_m, 0.0))
        pushes = [
            positive if x > 0 else negative
            for x, (positive, negative) in zip(missing, PUSHES, strict=True)
            if abs(x) > least
        ]
        return frozenset((*pushes, *gain)) if pushes else frozenset()

    def wanted_velocity(self, figures: DockingFigures, goal_m: float | None) -> FloatArray:
        """(3,) velocity along the port's axes, right, down, in, that the pilot wants [m s-1]."""
        f = figures
        on_axis = f.lateral_m <= self._limits.lateral_m and f.axial_m > 0
        if f.off_axis_deg > ROUND_ABOVE_DEG and not on_axis:
            return self._round(f)
        offset = np.array([f.right_m, f.down_m])
        away = float(np.linalg.norm(offset))
        across_m_s = min(ACROSS_GAIN_1_S * away, float(np.sqrt(2 * BRAKE_M_S2 * away)), ACROSS_M_S)
        across = -offset * (across_m_s / max(away, 1e-9))
        return np.array([*across, self._closing(f, goal_m)])

    def _closing(self, f: DockingFigures, goal_m: float | None) -> float:
        limits = self._limits
        left = f.axial_m - (goal_m or 0.0)
        allowed = LIMIT_SHARE * max(limits.closing_m_s, limits.closing_per_m * f.axial_m)
        if goal_m is None and f.axial_m < SLOW_WITHIN_M:
            speed = CONTACT_M_S if self._ready(f) else 0.0
            # too far in to wait for the attitude and the offset: a little back
            return speed if speed or f.axial_m > SLOW_WITHIN_M / 4 else -CONTACT_M_S / 2
        braking = float(np.sqrt(2 * BRAKE_M_S2 * abs(left)))
        if goal_m is None:
            braking = float(np.hypot(CONTACT_M_S, np.sqrt(2 * BRAKE_M_S2 * max(left - SLOW_WITHIN_M, 0.0))))
            speed = min(allowed, braking)
        else:
            speed = float(np.sign(left)) * min(allowed, braking, ALONG_GAIN_1_S * abs(left))
        # straight at the port only as far as the offset lets it: a funnel about the axis
        funnel = limits.lateral_m + 0.1 * max(f.axial_m, 0.0)
        return speed * float(np.clip(2.0 - f.lateral_m / funnel, 0.0, 1.0)) if speed > 0 else speed

    def _ready(self, f: DockingFigures) -> bool:
        limits = self._limits
        turned = max(abs(f.roll_deg), abs(f.pitch_deg), abs(f.yaw_deg))
        return f.lateral_m < 0.5 * limits.lateral_m and turned < 0.7 * limits.attitude_deg

    def _round(self, f: DockingFigures) -> FloatArray:
        """Along a sphere about the target towards the axis."""
        p = np.array([f.right_m, f.down_m, -f.axial_m]) + self._origin
        away = float(np.linalg.norm(p))
        out = p / away
        towards = np.array([0.0, 0.0, -1.0]) - (-out[2]) * out
        if np.linalg.norm(towards) < 1e-3:
            towards = np.cross(out, [0.0, 1.0, 0.0])
        towards /= np.linalg.norm(towards)
        # not inward on the way round, and outward first from too near
        rise = self._round_m - away
        outward = float(np.clip(ALONG_GAIN_1_S * rise, 0.0, ROUND_M_S))
        sideways = ROUND_M_S * float(np.clip(1.5 - max(rise, 0.0), 0.0, 1.0))
        return np.asarray(sideways * towards + outward * out)
