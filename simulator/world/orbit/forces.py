"""The forces on target and chaser: harmonics of the Earth, Sun and Moon, drag, the pressure of sunlight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from simulator.runtime.arrays import Vec3
from simulator.world.constants import (
    AU_M,
    EARTH_RADIUS_M,
    FLATTENING,
    MU_EARTH_M3_S2,
    MU_MOON_M3_S2,
    MU_SUN_M3_S2,
    SOLAR_PRESSURE_PA,
)
from simulator.world.ephemeris.eclipse import sun_visible_fraction
from simulator.world.orbit.density import density_kg_m3

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.world.ephemeris.ephemeris_table import SkyTable
    from simulator.world.orbit.spherical_harmonics import HarmonicField


class Forces(Protocol):
    """What accelerates the two craft; `simulator.world.orbit.gravity.Gravity` is the simplest.

    Positions are from the centre of the body that they circle, along GCRS axes.
    """

    @property
    def mu_m3_s2(self) -> float:
        """Gravitational parameter of the central body [m3 s-2]."""
        ...

    def target(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Acceleration of the target at ``r_eci_m``, GCRS [m s-2]."""
        ...

    def pair(
        self,
        t_s: float,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        p_eci_m: FloatArray,
        w_eci_m_s: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """The target's acceleration, and the chaser's less the target's; ``p``, ``w`` are chaser less target."""
        ...


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A craft as air and sunlight see it: a sphere of the same frontal area.

    Parameters
    ----------
    mass_kg, area_m2 : mass, mean frontal area.
    drag_coefficient : 2.2 is usual in free molecular flow.
    reflectivity : 1 absorbs all light, 2 mirrors it back.
    """

    mass_kg: float
    area_m2: float
    drag_coefficient: float = 2.2
    reflectivity: float = 1.3


@dataclass(frozen=True, eq=False, kw_only=True)
class FullForces:
    """Point mass, harmonics and whatever else is switched on.

    Parameters
    ----------
    sky : Earth orientation, Sun and Moon over the flight.
    harmonics : of degree 2 and up; None leaves a round Earth.
    sun, moon : whether they attract. drag, solar_pressure : whether they push.
    craft : target's and chaser's surfaces, for the last two.
    """

    sky: SkyTable
    harmonics: HarmonicField | None = None
    sun: bool = False
    moon: bool = False
    drag: bool = False
    solar_pressure: bool = False
    craft: tuple[Surface, Surface] | None = None

    @property
    def mu_m3_s2(self) -> float:
        """Gravitational parameter of the Earth: the one that belongs to the coefficients."""
        return self.harmonics.mu_m3_s2 if self.harmonics else MU_EARTH_M3_S2

    def target(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Acceleration of the target, GCRS [m s-2]."""
        return self._both(t_s, r_eci_m, v_eci_m_s, None)[0]

    def pair(
        self,
        t_s: float,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        p_eci_m: FloatArray,
        w_eci_m_s: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """The target's acceleration and the chaser's less it; the large terms are differenced in closed form."""
        return self._both(t_s, r_eci_m, v_eci_m_s, (p_eci_m, w_eci_m_s))

    def _both(
        self,
        t_s: float,
        r: FloatArray,
        v: FloatArray,
        chaser: tuple[FloatArray, FloatArray] | None,
    ) -> tuple[FloatArray, FloatArray]:
        R, sun, moon = self.sky.at(t_s)
        p = None if chaser is None else chaser[0]
        a = np.array(attraction(r.tolist(), self.mu_m3_s2))
        d = (
            np.zeros(3)
            if p is None
            else np.array(attraction_difference(r.tolist(), p.tolist(), self.mu_m3_s2))
        )
        if self.harmonics is not None:
            points = r[None] if p is None else np.stack([r, r + p])
            g = self.harmonics.acceleration(points @ R.T) @ R
            a = a + g[0]
            d = d if p is None else d + (g[1] - g[0])
        for on, body, mu in ((self.sun, sun, MU_SUN_M3_S2), (self.moon, moon, MU_MOON_M3_S2)):
            if on:
                a = a + third_body(r.tolist(), body.tolist(), mu)
                if p is not None:
                    d = d + attraction_difference((r - body).tolist(), p.tolist(), mu)
        if self.craft is not None and (self.drag or self.solar_pressure):
            own = self._surface_acceleration(self.craft[0], r, v, sun, R)
            a = a + own
            if chaser is not None:
                other = self._surface_acceleration(self.craft[1], r + chaser[0], v + chaser[1], sun, R)
                d = d + (other - own)
        return a, d

    def _surface_acceleration(
        self, craft: Surface, r: FloatArray, v: FloatArray, sun: FloatArray, R_itrs_from_eci: FloatArray
    ) -> FloatArray:
        a = np.zeros(3)
        if self.drag:
            # the air turns with the Earth, about the pole of date
            pole = R_itrs_from_eci[2]
            wind = v - self.sky.era_rate_rad_s * np.cross(pole, r)
            rho = density_kg_m3(geodetic_altitude_m(r, float(pole @ r)))
            factor = craft.drag_coefficient * craft.area_m2 / craft.mass_kg
            a -= 0.5 * rho * factor * float(np.linalg.norm(wind)) * wind
        if self.solar_pressure:
            a += light_pressure(craft, r - sun, float(sun_visible_fraction(r, sun, R_itrs_from_eci[2])))
        return a


def light_pressure(craft: Surface, from_sun_m: FloatArray, seen: float) -> FloatArray:
    """Acceleration by sunlight on a craft at (3,) ``from_sun_m``, which sees this share of the Sun [m s-2].

    References
    ----------
    Montenbruck & Gill (2000), Satellite Orbits, eq. 3.75.
    """
    distance = float(np.linalg.norm(from_sun_m))
    factor = craft.reflectivity * craft.area_m2 / craft.mass_kg
    return np.asarray(seen * SOLAR_PRESSURE_PA * factor * (AU_M / distance) ** 2 / distance * from_sun_m)


def geodetic_altitude_m(r_eci_m: FloatArray, along_pole_m: float) -> float:
    """Height above the WGS 84 ellipsoid to first order in its flattening (30 m) [m]."""
    r = float(np.linalg.norm(r_eci_m))
    return r - EARTH_RADIUS_M * (1 - FLATTENING * (along_pole_m / r) ** 2)


def attraction(r_m: list[float], mu_m3_s2: float) -> Vec3:
    """Acceleration towards a point mass at the origin [m s-2]."""
    x, y, z = r_m
    square = x * x + y * y + z * z
    k = -mu_m3_s2 / (square * math.sqrt(square))
    return (k * x, k * y, k * z)


def attraction_difference(r_m: list[float], p_m: list[float], mu_m3_s2: float) -> Vec3:
    """`attraction` at ``r + p`` less that at ``r``, without subtracting two nearly equal vectors [m s-2].

    References
    ----------
    Battin (1999), Mathematics and Methods of Astrodynamics, sec. 8.4, eq. 8.61-8.62.
    """
    x, y, z = r_m
    px, py, pz = p_m
    square = x * x + y * y + z * z
    q = (px * (px + 2 * x) + py * (py + 2 * y) + pz * (pz + 2 * z)) / square
    stretch = (1 + q) * math.sqrt(1 + q)
    f = q * (3 + q * (3 + q)) / (1 + stretch)
    k = -mu_m3_s2 / (square * math.sqrt(square) * stretch)
    return (k * (px - f * x), k * (py - f * y), k * (pz - f * z))


def third_body(r_m: list[float], body_m: list[float], mu_m3_s2: float) -> Vec3:
    """What a distant body adds to the motion about the Earth [m s-2]: its pull here less its pull there."""
    bx, by, bz = body_m
    return attraction_difference([-bx, -by, -bz], r_m, mu_m3_s2)
