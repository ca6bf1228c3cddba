"""Mercury to Saturn as point sources: positions and magnitudes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.world.constants import AU_M
from flyaround.simulator.world.time.instant import Instant, without_year_warning

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class _Planet:
    """Photometry of a planet.

    Parameters
    ----------
    name : str
        Name of the planet.
    number : int
        SOFA's number of the planet.
    magnitude : float
        V at 1 au from Sun and Earth.
    phase : tuple of float
        Coefficients of the powers 1, 2, 3 of the phase angle in degrees.
    b_minus_v : float
        Colour index B - V.
    """

    name: str
    number: int
    magnitude: float
    phase: tuple[float, float, float]
    b_minus_v: float


# Meeus (1998), Astronomical Algorithms, ch. 41: the formulas of the Astronomical Almanac since 1984; Saturn without its
# rings, which brighten it by up to one magnitude
_PLANETS = (
    _Planet("Mercury", 1, -0.42, (3.80e-2, -2.73e-4, 2.0e-6), 0.97),
    _Planet("Venus", 2, -4.40, (9.0e-4, 2.39e-4, -6.5e-7), 0.81),
    _Planet("Mars", 4, -1.52, (1.6e-2, 0.0, 0.0), 1.43),
    _Planet("Jupiter", 5, -9.40, (5.0e-3, 0.0, 0.0), 0.87),
    _Planet("Saturn", 6, -8.88, (4.4e-2, 0.0, 0.0), 1.09),
)
NAMES = tuple(planet.name for planet in _PLANETS)
_LIGHT_DAYS_PER_AU = 499.004784 / 86400.0  # light time of an astronomical unit [days]


@dataclass(frozen=True, eq=False)
class PlanetLight:
    """Planets seen from a position: unit directions (5, 3) GCRS without aberration, V magnitudes, B-V colours."""

    directions: FloatArray
    v_mag: FloatArray
    b_minus_v: FloatArray


def planets(epoch_utc: str, observer_eci_m: FloatArray) -> PlanetLight:
    """Return the five bright planets, in the order of ``NAMES``.

    Positions are SOFA's ``iauPlan94``: within half an arc minute, for Saturn one and a half, over 1900-2100; rounded to
    the minute, in which Mercury moves by 5 arc seconds.

    Parameters
    ----------
    epoch_utc : str
        Time, UTC.
    observer_eci_m : (3,) array
        Position from the Earth's centre.

    Returns
    -------
    PlanetLight
        Directions, magnitudes and colours.
    """
    almanac = _almanac(epoch_utc[: len("2026-01-01T00:00")])
    relative = almanac.geocentric_m - np.asarray(observer_eci_m, float)
    directions = relative / np.linalg.norm(relative, axis=1, keepdims=True)
    return PlanetLight(directions, almanac.v_mag, np.array([p.b_minus_v for p in _PLANETS]))


def earth_velocity_c(epoch_utc: str) -> FloatArray:
    """Return the barycentric velocity of the Earth over that of light, which shifts stars by up to 20.5".

    Returns
    -------
    (3,) array
        Velocity in units of the speed of light, GCRS axes, at the start of the epoch's minute.
    """
    return _almanac(epoch_utc[: len("2026-01-01T00:00")]).earth_c


@dataclass(frozen=True, eq=False)
class _Almanac:
    geocentric_m: FloatArray
    v_mag: FloatArray
    earth_c: FloatArray


@lru_cache(maxsize=64)
def _almanac(minute_utc: str) -> _Almanac:
    now = Instant.from_utc(f"{minute_utc}:00Z")
    heliocentric, barycentric = without_year_warning(erfa.epv00, now.tt1, now.tt2)
    earth = np.asarray(heliocentric["p"], float)
    geocentric, magnitudes = [], []
    for planet in _PLANETS:
        position = np.asarray(without_year_warning(erfa.plan94, now.tt1, now.tt2, planet.number)["p"], float)
        delay = float(np.linalg.norm(position - earth)) * _LIGHT_DAYS_PER_AU
        position = np.asarray(
            without_year_warning(erfa.plan94, now.tt1, now.tt2 - delay, planet.number)["p"], float
        )
        relative = position - earth
        r, d = float(np.linalg.norm(position)), float(np.linalg.norm(relative))
        phase = np.degrees(np.arccos(np.clip(position @ relative / (r * d), -1, 1)))
        a, b, c = planet.phase
        magnitudes.append(planet.magnitude + 5 * np.log10(r * d) + a * phase + b * phase**2 + c * phase**3)
        geocentric.append(relative * AU_M)
    earth_c = np.asarray(barycentric["v"], float) * _LIGHT_DAYS_PER_AU
    return _Almanac(np.array(geocentric), np.array(magnitudes), earth_c)
