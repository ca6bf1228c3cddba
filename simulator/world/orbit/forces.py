"""Forces on target and chaser: Earth harmonics, Sun and Moon, drag, solar radiation pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Protocol

import erfa
import msgspec
import numpy as np
from msgspec import Meta

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.world.constants import (
    AU_M,
    EARTH_RADIUS_M,
    FLATTENING,
    MU_EARTH_M3_S2,
    MU_MOON_M3_S2,
    MU_SUN_M3_S2,
    SOLAR_PRESSURE_PA,
)
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_earth

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
    from flyaround.simulator.world.orbit.spherical_harmonics import HarmonicField

_AIR_LAYERS = (
    (100.0, 5.297e-7, 5.877),
    (110.0, 9.661e-8, 7.263),
    (120.0, 2.438e-8, 9.473),
    (130.0, 8.484e-9, 12.636),
    (140.0, 3.845e-9, 16.149),
    (150.0, 2.070e-9, 22.523),
    (180.0, 5.464e-10, 29.740),
    (200.0, 2.789e-10, 37.105),
    (250.0, 7.248e-11, 45.546),
    (300.0, 2.418e-11, 53.628),
    (350.0, 9.518e-12, 53.298),
    (400.0, 3.725e-12, 58.515),
    (450.0, 1.585e-12, 60.828),
    (500.0, 6.967e-13, 63.822),
    (600.0, 1.454e-13, 71.835),
    (700.0, 3.614e-14, 88.667),
    (800.0, 1.170e-14, 124.64),
    (900.0, 5.245e-15, 181.05),
    (1000.0, 3.019e-15, 268.00),
)
"""Base altitude [km], density there [kg m-3] and scale height [km] of each layer; see `density_kg_m3`."""
_BREAK_UP_M = 80e3
"""Altitude at which spacecraft that decay break up (ESA Re-entry Guidelines: 75 to 85 km)."""


class ForceModel(Protocol):
    """Accelerations of the two craft; `flyaround.simulator.world.orbit.gravity.Gravity` is the simplest.

    Positions are from the centre of the central body, along GCRS axes.
    """

    @property
    def mu_m3_s2(self) -> float:
        """Gravitational parameter of the central body [m3 s-2]."""
        ...

    @property
    def solar_pressure(self) -> bool:
        """True if solar radiation pressure acts, which changes abruptly at the shadow's edge."""
        ...

    def target(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Compute the acceleration of the target.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].
        """
        ...

    def pair(
        self,
        t_s: float,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        p_eci_m: FloatArray,
        w_eci_m_s: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the target's acceleration, and chaser minus target, GCRS [m s-2].

        Parameters
        ----------
        t_s : float
            Time since the start [s].
        r_eci_m : (3,) array
            Position of the target [m].
        v_eci_m_s : (3,) array
            Velocity of the target [m s-1].
        p_eci_m : (3,) array
            Position of the chaser relative to the target [m].
        w_eci_m_s : (3,) array
            Velocity of the chaser relative to the target [m s-1].

        Returns
        -------
        tuple of array
            Acceleration (3,) of the target, and difference (3,) [m s-2].
        """
        ...


class Surface(Section, frozen=True, kw_only=True):
    """Surface of a craft for drag and sunlight; the target's default mass is that of its model."""

    mass_kg: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    # mean frontal area, of a sphere as seen by air and sunlight
    area_m2: Annotated[float, Meta(gt=0, le=1e5)] = 1.0
    # 2.2 is usual in free molecular flow
    drag_coefficient: Annotated[float, Meta(ge=0, le=10)] = 2.2
    # 1: absorbing, 2: reflecting
    reflectivity: Annotated[float, Meta(ge=0, le=2)] = 1.3

    def push_per_pressure_m2_kg(self, coefficient: float) -> float:
        """Return acceleration over pressure, for a coefficient of drag or reflectivity [m2 kg-1].

        Raises
        ------
        ValueError
            If the mass is unknown.
        """
        if self.mass_kg is None:
            raise ValueError("the mass of a craft under drag or sunlight is not given")
        return coefficient * self.area_m2 / self.mass_kg


class Forces(Section, frozen=True, kw_only=True):
    """Forces on both craft. ``gravity_degree``: 0 for a point mass, 2 to 70 for EGM96; without this section J2 only.

    About the Moon the Earth always acts, and the degree is 0 (the default) or 2.
    """

    gravity_degree: Annotated[int, Meta(ge=0, le=70)] | None = None
    sun: bool = False
    moon: bool = False
    drag: bool = False
    solar_pressure: bool = False
    target: Surface = Surface()
    chaser: Surface = Surface()

    def with_masses(self, target_kg: float, chaser_kg: float) -> Forces:
        """Fill in the masses where none are given.

        Returns
        -------
        Forces
            Copy in which both craft have a mass [kg].
        """
        target, chaser = (
            msgspec.structs.replace(craft, mass_kg=craft.mass_kg or mass_kg)
            for craft, mass_kg in ((self.target, target_kg), (self.chaser, chaser_kg))
        )
        return msgspec.structs.replace(self, target=target, chaser=chaser)


GRAVITY_ALONE = Forces()
"""Gravity of the central body only."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EarthForces:
    """Forces about the Earth: its point mass and harmonics, and further forces as selected.

    Parameters
    ----------
    sky : EphemerisTable
        Earth orientation, Sun and Moon over the flight.
    forces : Forces, optional
        Forces besides the Earth's gravity; drag and sunlight need masses.
    harmonics : HarmonicField, optional
        Harmonics of degree 2 and up; None for a spherical Earth.
    """

    sky: EphemerisTable
    forces: Forces = GRAVITY_ALONE
    harmonics: HarmonicField | None = None

    @property
    def solar_pressure(self) -> bool:
        """True if solar radiation pressure acts."""
        return self.forces.solar_pressure

    @property
    def mu_m3_s2(self) -> float:
        """Gravitational parameter of the Earth that belongs to the coefficients."""
        return self.harmonics.mu_m3_s2 if self.harmonics else MU_EARTH_M3_S2

    def target(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Compute the acceleration of the target.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].

        Raises
        ------
        UserError
            If drag acts and the target is below 80 km, where it breaks up.
        ValueError
            If drag or sunlight acts on a craft of unknown mass.
        """
        return self._accelerations(t_s, r_eci_m, v_eci_m_s, None)[0]

    def pair(
        self,
        t_s: float,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        p_eci_m: FloatArray,
        w_eci_m_s: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the acceleration of the target, and that of the chaser relative to it.

        Large terms are subtracted in closed form.

        Returns
        -------
        tuple of array
            Acceleration (3,) of the target, and chaser minus target (3,), GCRS axes [m s-2].

        Raises
        ------
        UserError
            If drag acts and a craft is below 80 km, where it breaks up.
        ValueError
            If drag or sunlight acts on a craft of unknown mass.
        """
        return self._accelerations(t_s, r_eci_m, v_eci_m_s, (p_eci_m, w_eci_m_s))

    def _accelerations(
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
        for is_acting, body, mu in (
            (self.forces.sun, sun, MU_SUN_M3_S2),
            (self.forces.moon, moon, MU_MOON_M3_S2),
        ):
            if is_acting:
                a = a + third_body(r.tolist(), body.tolist(), mu)
                if p is not None:
                    d = d + attraction_difference((r - body).tolist(), p.tolist(), mu)
        if self.forces.drag or self.forces.solar_pressure:
            target_push = self._surface_acceleration(t_s, self.forces.target, r, v, sun, R)
            a = a + target_push
            if chaser is not None:
                chaser_push = self._surface_acceleration(
                    t_s, self.forces.chaser, r + chaser[0], v + chaser[1], sun, R
                )
                d = d + (chaser_push - target_push)
        return a, d

    def _surface_acceleration(
        self,
        t_s: float,
        craft: Surface,
        r: FloatArray,
        v: FloatArray,
        sun: FloatArray,
        R_itrs_from_eci: FloatArray,
    ) -> FloatArray:
        a = np.zeros(3)
        if self.forces.drag:
            # the air rotates with the Earth, about the pole of date
            pole = R_itrs_from_eci[2]
            wind = v - self.sky.era_rate_rad_s * np.cross(pole, r)
            altitude_m = geodetic_altitude_m(r, float(pole @ r))
            if altitude_m < _BREAK_UP_M:
                raise UserError(
                    f"the air has brought a craft down to {_BREAK_UP_M / 1e3:.0f} km {t_s:.0f} s after the "
                    "start, where it "
                    "breaks up: shorten duration_s, or start higher"
                )
            rho = density_kg_m3(altitude_m)
            factor = craft.push_per_pressure_m2_kg(craft.drag_coefficient)
            a -= 0.5 * rho * factor * float(np.linalg.norm(wind)) * wind
        if self.forces.solar_pressure:
            a += light_pressure(craft, r - sun, float(sun_fraction_past_earth(r, sun, R_itrs_from_eci[2])))
        return a


def light_pressure(craft: Surface, from_sun_m: FloatArray, sun_share: float) -> FloatArray:
    """Compute the acceleration of a craft by solar radiation pressure.

    Parameters
    ----------
    craft : Surface
        Area, mass and reflectivity.
    from_sun_m : (3,) array
        Position of the craft relative to the Sun [m].
    sun_share : float
        Visible fraction of the Sun's disc.

    Returns
    -------
    (3,) array
        Acceleration away from the Sun [m s-2], along the axes of ``from_sun_m``.

    Raises
    ------
    ValueError
        If the craft's mass is unknown.

    References
    ----------
    Montenbruck & Gill (2000), Satellite Orbits (radiation pressure).
    """
    distance = float(np.linalg.norm(from_sun_m))
    factor = craft.push_per_pressure_m2_kg(craft.reflectivity)
    return np.asarray(sun_share * SOLAR_PRESSURE_PA * factor * (AU_M / distance) ** 2 / distance * from_sun_m)


def geodetic_altitude_m(r_eci_m: FloatArray, z_m: float) -> float:
    """Compute the height of a position above the WGS 84 ellipsoid.

    Parameters
    ----------
    r_eci_m : (3,) array
        Position from the Earth's centre [m].
    z_m : float
        Its distance north of the equatorial plane, along the pole of date; negative in the south.

    Returns
    -------
    float
        Geodetic altitude [m], negative inside the ellipsoid.
    """
    equatorial_m = math.sqrt(max(float(r_eci_m @ r_eci_m) - z_m**2, 0.0))
    return float(erfa.gc2gde(EARTH_RADIUS_M, FLATTENING, [equatorial_m, 0.0, z_m])[2])


def density_kg_m3(altitude_m: float) -> float:
    """Return the density of the air at ``altitude_m`` above the ellipsoid [kg m-3].

    The model is a mean of day and night at moderate solar activity (exospheric temperature 1000 K). At 600 km the true
    density varies tenfold over a solar cycle. Below 100 km the lowest layer is extrapolated.

    References
    ----------
    Vallado (2013), Fundamentals of Astrodynamics, 4th ed., table 8-4.
    """
    h = altitude_m / 1e3
    base, density, scale = next((layer for layer in reversed(_AIR_LAYERS) if h >= layer[0]), _AIR_LAYERS[0])
    return density * math.exp((base - h) / scale)


def attraction(r_m: list[float], mu_m3_s2: float) -> Vec3:
    """Return the acceleration (3,) at ``r_m`` towards a point mass at the origin [m s-2]."""
    x, y, z = r_m
    r2 = x * x + y * y + z * z
    k = -mu_m3_s2 / (r2 * math.sqrt(r2))
    return (k * x, k * y, k * z)


def attraction_difference(r_m: list[float], p_m: list[float], mu_m3_s2: float) -> Vec3:
    """Return `attraction` at ``r + p`` minus that at ``r``, without cancellation [m s-2].

    References
    ----------
    Battin (1999), Mathematics and Methods of Astrodynamics: f(q) of Encke's method.
    """
    x, y, z = r_m
    px, py, pz = p_m
    r2 = x * x + y * y + z * z
    q = (px * (px + 2 * x) + py * (py + 2 * y) + pz * (pz + 2 * z)) / r2
    ratio3 = (1 + q) * math.sqrt(1 + q)
    f = q * (3 + q * (3 + q)) / (1 + ratio3)
    k = -mu_m3_s2 / (r2 * math.sqrt(r2) * ratio3)
    return (k * (px - f * x), k * (py - f * y), k * (pz - f * z))


def third_body(r_m: list[float], body_m: list[float], mu_m3_s2: float) -> Vec3:
    """Return the tidal acceleration of a distant body on the motion about the Earth [m s-2]."""
    bx, by, bz = body_m
    return attraction_difference([-bx, -by, -bz], r_m, mu_m3_s2)
