"""Thrusters: what a commanded change of velocity becomes under force limits, minimum impulse and mass flow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulator.runtime.arrays import FloatArray

_G0_M_S2 = 9.80665


@dataclass(frozen=True, kw_only=True)
class Thrusters:
    """Thrusters on all six sides of a chaser that keeps its sides along LVLH.

    Parameters
    ----------
    mass_kg : at the start. force_n : limit along each axis. minimum_impulse_ns : shortest pulse, along each axis.
    specific_impulse_s : gives the mass flow. period_s : of control; thrust is constant over it.
    """

    mass_kg: float = 100.0
    force_n: float = 1.0
    minimum_impulse_ns: float = 0.01
    specific_impulse_s: float = 220.0
    period_s: float = 1.0

    def fire(self, wanted_m_s: FloatArray, mass_kg: float) -> tuple[FloatArray, float]:
        """The change of velocity of one period that the thrusters give [m s-1], and the mass after it [kg].

        Parameters
        ----------
        wanted_m_s : (3,) LVLH. mass_kg : before it.
        """
        impulse = np.clip(wanted_m_s * mass_kg, -self.force_n * self.period_s, self.force_n * self.period_s)
        impulse = np.where(np.abs(impulse) < self.minimum_impulse_ns, 0.0, impulse)
        used = float(np.sum(np.abs(impulse))) / (self.specific_impulse_s * _G0_M_S2)
        return impulse / mass_kg, mass_kg - used
