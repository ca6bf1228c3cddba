"""Forces on two craft in orbit about the Moon: its gravity, Earth and Sun as third bodies, and sunlight."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import MOON_RADIUS_M, MU_EARTH_M3_S2, MU_MOON_M3_S2, MU_SUN_M3_S2
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_earth, sun_fraction_past_sphere
from flyaround.simulator.world.ephemeris.moon_orientation import R_moon_from_eci
from flyaround.simulator.world.orbit.forces import (
    GRAVITY_ALONE,
    Forces,
    attraction,
    attraction_difference,
    light_pressure,
    third_body,
)
from flyaround.simulator.world.orbit.spherical_harmonics import HarmonicField, harmonic_field

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
    from flyaround.simulator.world.orbit.forces import Surface
    from flyaround.simulator.world.time.instant import Instant

MOON_DEGREE = 2
"""The only supported degree of the Moon's gravity."""
_C20, _C22 = -9.08828e-5, 3.46737e-5
"""Fully normalised coefficients in principal axes, which differ from the mean Earth / polar axes by 0.6 mrad."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MoonForces:
    """Forces about the Moon: its point mass, the Earth's attraction, and further forces as selected.

    Positions and velocities are from the Moon's centre, along GCRS axes.

    Parameters
    ----------
    epoch : Instant
        Start of the flight.
    sky : EphemerisTable
        Sun and Moon over the flight.
    forces : Forces, optional
        Forces besides the point masses. Degree 2 of gravity is the Moon's flattening and its bulge towards the Earth.
    """

    epoch: Instant
    sky: EphemerisTable
    forces: Forces = GRAVITY_ALONE

    @property
    def solar_pressure(self) -> bool:
        """True if solar radiation pressure acts."""
        return self.forces.solar_pressure

    @property
    def mu_m3_s2(self) -> float:
        """Gravitational parameter of the Moon."""
        return MU_MOON_M3_S2

    def target(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Compute the acceleration of the target.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].
        """
        return self.pair(t_s, r_eci_m, v_eci_m_s, np.zeros(3), np.zeros(3))[0]

    def pair(
        self,
        t_s: float,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,  # noqa: ARG002 - there is no air
        p_eci_m: FloatArray,
        w_eci_m_s: FloatArray,  # noqa: ARG002
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the acceleration of the target, and that of the chaser relative to it.

        Large terms are subtracted in closed form.

        Returns
        -------
        tuple of array
            Acceleration (3,) of the target, and chaser minus target (3,), GCRS axes [m s-2].
        """
        r, p = r_eci_m, p_eci_m
        _, sun_from_earth, moon = self.sky.at(t_s)
        sun = sun_from_earth - moon
        acceleration = np.array(attraction(r.tolist(), MU_MOON_M3_S2))
        difference = np.array(attraction_difference(r.tolist(), p.tolist(), MU_MOON_M3_S2))
        bodies = [(-moon, MU_EARTH_M3_S2)] + ([(sun, MU_SUN_M3_S2)] if self.forces.sun else [])
        for body, mu in bodies:
            acceleration = acceleration + third_body(r.tolist(), body.tolist(), mu)
            difference = difference + attraction_difference((r - body).tolist(), p.tolist(), mu)
        if self.forces.gravity_degree == MOON_DEGREE:
            R = R_moon_from_eci(self.epoch.plus(t_s))
            harmonics = lunar_degree_2().acceleration(np.stack([r, r + p]) @ R.T) @ R
            acceleration, difference = acceleration + harmonics[0], difference + (harmonics[1] - harmonics[0])
        if self.forces.solar_pressure:
            target_push = self._light_pressure(self.forces.target, r, sun, moon)
            chaser_push = self._light_pressure(self.forces.chaser, r + p, sun, moon)
            acceleration, difference = acceleration + target_push, difference + (chaser_push - target_push)
        return acceleration, difference

    def _light_pressure(self, craft: Surface, r: FloatArray, sun: FloatArray, moon: FloatArray) -> FloatArray:
        past_moon = float(sun_fraction_past_sphere(r, sun, MOON_RADIUS_M))
        past_earth = float(sun_fraction_past_earth(r + moon, sun + moon))
        return light_pressure(craft, r - sun, max(past_moon + past_earth - 1.0, 0.0))


@lru_cache(maxsize=1)
def lunar_degree_2() -> HarmonicField:
    """Return the Moon's flattening and equatorial bulge, in its mean Earth / polar axis frame.

    References
    ----------
    Konopliv et al. (2013), The JPL lunar gravity field to spherical harmonic degree 660, JGR Planets 118.
    """
    C, S = np.zeros((3, 3)), np.zeros((3, 3))
    C[2, 0], C[2, 2] = _C20, _C22
    return harmonic_field(MU_MOON_M3_S2, MOON_RADIUS_M, C, S)
