"""Thrusters: force limits, minimum impulse and mass flow for a commanded velocity change."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.world.constants import G0_M_S2

CHASER_MASS_KG = 100.0
"""Default mass of a chaser [kg]."""


class Thrusters(Section, frozen=True, kw_only=True):
    """Thrusters of the chaser; it follows its path only as well as they can."""

    # on all six sides of a chaser aligned with LVLH; initial mass, by default [forces.chaser]'s
    mass_kg: Annotated[float, Meta(gt=0, le=1e6)] = CHASER_MASS_KG
    # limit along each axis, and the shortest pulse
    force_n: Annotated[float, Meta(gt=0, le=1e5)] = 1.0
    minimum_impulse_ns: Annotated[float, Meta(ge=0, le=1e3)] = 0.01
    # determines the mass flow
    specific_impulse_s: Annotated[float, Meta(gt=0, le=1e4)] = 220.0
    # control period; thrust is constant over it
    period_s: Annotated[float, Meta(ge=0.05, le=60)] = 1.0

    def fire(self, commanded_m_s: FloatArray, mass_kg: float) -> tuple[FloatArray, float]:
        """Return the velocity change (3,) delivered in one period [m s-1], and the mass after it [kg].

        Parameters
        ----------
        commanded_m_s : (3,) array
            Commanded velocity change, LVLH axes.
        mass_kg : float
            Mass before the period.
        """
        impulse = np.clip(
            commanded_m_s * mass_kg, -self.force_n * self.period_s, self.force_n * self.period_s
        )
        impulse = np.where(np.abs(impulse) < self.minimum_impulse_ns, 0.0, impulse)
        propellant_kg = float(np.sum(np.abs(impulse))) / (self.specific_impulse_s * G0_M_S2)
        return impulse / mass_kg, mass_kg - propellant_kg
