"""Cost of manual control: delta-v, propellant, and plume impingement on the target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import G0_M_S2
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.manual_control import ChaserState
    from flyaround.simulator.world.guidance.thrusters import Thrusters

# Half angle of the cone within which a thruster's plume strikes the target [deg].
PLUME_HALF_ANGLE_DEG = 30.0

PLUME_RANGE_M = 20.0
"""Distance from the target's hull beyond which a plume is harmless [m]."""


@dataclass(frozen=True)
class Propellant:
    """Applied delta-v and used propellant.

    Parameters
    ----------
    thrusters : Thrusters
        Mass at the start and specific impulse.
    delta_v_m_s : float, optional
        Applied delta-v.
    used_kg : float, optional
        Propellant used so far.
    """

    thrusters: Thrusters
    delta_v_m_s: float = 0.0
    used_kg: float = 0.0

    @property
    def mass_kg(self) -> float:
        """Present mass of the chaser [kg]."""
        return self.thrusters.mass_kg - self.used_kg

    def after(self, acceleration_camera_m_s2: FloatArray, dt_s: float) -> Propellant:
        """Return the totals after an acceleration.

        Thrusters are on the six sides of the chaser, along camera axes: an oblique acceleration uses propellant on each
        axis, while its delta-v is that of the vector sum.

        Parameters
        ----------
        acceleration_camera_m_s2 : (3,) array
            Applied for ``dt_s``.
        dt_s : float
            Duration of the acceleration [s].
        """
        if not acceleration_camera_m_s2.any():
            return self
        force_n = self.mass_kg * float(np.abs(acceleration_camera_m_s2).sum())
        burnt = force_n * dt_s / (self.thrusters.specific_impulse_s * G0_M_S2)
        delta_v_m_s = float(np.linalg.norm(acceleration_camera_m_s2)) * dt_s
        return Propellant(self.thrusters, self.delta_v_m_s + delta_v_m_s, self.used_kg + burnt)


def plume_strikes(chaser: ChaserState, acceleration_camera_m_s2: FloatArray, target_radius_m: float) -> bool:
    """Return True if the exhaust of a thrust hits the target from nearby.

    Exhaust leaves opposite to the acceleration along each axis separately, as the thrusters do.

    Parameters
    ----------
    chaser : ChaserState
        State of the chaser.
    acceleration_camera_m_s2 : (3,) array
        Acceleration.
    target_radius_m : float
        Radius of the sphere about the target.
    """
    los = -matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.position_eci_m)
    distance = float(np.linalg.norm(los))
    if distance - target_radius_m > PLUME_RANGE_M:
        return False
    # part of the sphere inside the cone
    half_angle = np.arcsin(min(target_radius_m / distance, 1.0))
    widest = min(np.radians(PLUME_HALF_ANGLE_DEG) + half_angle, np.pi)
    pushed = np.abs(acceleration_camera_m_s2) > 0
    towards = -np.sign(acceleration_camera_m_s2) * los / distance
    return bool(np.any(pushed & (towards >= np.cos(widest))))
