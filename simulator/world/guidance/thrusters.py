"""Thrusters: force limits, minimum impulse and mass flow for a commanded velocity change."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.world.constants import G0_M_S2

CHASER_MASS_KG = 100.0
"""Default mass of a chaser [kg], that of a small inspector; it scales acceleration and propellant."""


class Thrusters(Section, frozen=True, kw_only=True):
    """Thrusters on all six sides of a chaser aligned with LVLH, which follows its path only as well as they can.

    The defaults are typical of hydrazine thrusters of 1 N: specific impulses of 200 to 223 s, pulses from 0.01 N s.

    Attributes
    ----------
    mass_kg : float
        Initial mass, by default that of ``[forces.chaser]``.
    force_n : float
        Largest force along each axis.
    minimum_impulse_ns : float
        Impulse of the shortest pulse along an axis; smaller ones are not fired.
    specific_impulse_s : float
        Specific impulse, which determines the mass flow.
    period_s : float
        Control period, over which the thrust is constant.
    """

    mass_kg: Annotated[float, Meta(gt=0, le=1e6)] = CHASER_MASS_KG
    force_n: Annotated[float, Meta(gt=0, le=1e5)] = 1.0
    minimum_impulse_ns: Annotated[float, Meta(ge=0, le=1e3)] = 0.01
    specific_impulse_s: Annotated[float, Meta(gt=0, le=1e4)] = 220.0
    period_s: Annotated[float, Meta(ge=0.05, le=60)] = 1.0

    def fire(self, commanded_m_s: FloatArray, mass_kg: float) -> tuple[FloatArray, float]:
        """Return the velocity change (3,) delivered in one period [m s-1], and the mass after it [kg].

        Parameters
        ----------
        commanded_m_s : (3,) array
            Commanded velocity change, LVLH axes.
        mass_kg : float
            Mass before the period.

        Returns
        -------
        (3,) array
            Velocity change [m s-1].
        float
            Mass after it [kg].

        Raises
        ------
        UserError
            If the propellant would exceed the mass.
        """
        impulse = np.clip(
            commanded_m_s * mass_kg, -self.force_n * self.period_s, self.force_n * self.period_s
        )
        impulse = np.where(np.abs(impulse) < self.minimum_impulse_ns, 0.0, impulse)
        propellant_kg = float(np.sum(np.abs(impulse))) / (self.specific_impulse_s * G0_M_S2)
        if propellant_kg >= mass_kg:
            raise UserError(
                f"the thrusters would burn {propellant_kg:.3g} kg of a chaser of {mass_kg:.3g} kg in one period: raise "
                "chaser.thrusters.mass_kg or specific_impulse_s, or lower force_n"
            )
        return impulse / mass_kg, mass_kg - propellant_kg
