"""How much of the Sun's disc a spacecraft sees past the Earth and the Moon."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.world.constants import EARTH_RADIUS_M, MOON_RADIUS_M, SUN_RADIUS_M

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.arrays import FloatArray


def sun_fraction_past_both(r_eci_m: ArrayLike, r_sun_eci_m: ArrayLike, r_moon_eci_m: ArrayLike) -> float:
    """Share of the Sun's disc that neither the Earth nor the Moon hides from one spacecraft.

    What each hides is added: both cover a part of the Sun at once for some seconds a century.

    Parameters
    ----------
    r_eci_m, r_sun_eci_m, r_moon_eci_m : (3,) spacecraft, Sun and Moon from the Earth's centre [m].
    """
    r, sun, moon = (np.asarray(x, float) for x in (r_eci_m, r_sun_eci_m, r_moon_eci_m))
    past_earth = float(sun_visible_fraction(r, sun))
    past_moon = float(sun_visible_fraction(r - moon, sun - moon, MOON_RADIUS_M))
    return max(past_earth + past_moon - 1.0, 0.0)


def sun_visible_fraction(
    r_eci_m: ArrayLike, r_sun_eci_m: ArrayLike, radius_m: float = EARTH_RADIUS_M
) -> FloatArray:
    """Share of the Sun's disc not hidden by a spherical body: 1 in sunlight, 0 in umbra.

    The two discs overlap as plane circles of their angular radii, as is usual: within the half degree of
    the Sun the body's limb is straight enough. The atmosphere neither absorbs nor bends.

    Parameters
    ----------
    r_eci_m : (..., 3) spacecraft from the body's centre, the Earth's unless ``radius_m`` is another's [m].
    r_sun_eci_m : (..., 3) Sun from the body's centre [m].
    radius_m : of the body.

    Returns
    -------
    (...) fraction, 0..1.

    References
    ----------
    Montenbruck & Gill (2000), Satellite Orbits, sec. 3.4.2.
    """
    r = np.asarray(r_eci_m, float)
    to_sun = np.asarray(r_sun_eci_m, float) - r
    distance = np.linalg.norm(r, axis=-1)
    sun_distance = np.linalg.norm(to_sun, axis=-1)
    a = np.arcsin(SUN_RADIUS_M / sun_distance)
    b = np.arcsin(np.minimum(radius_m / distance, 1.0))
    cross = np.linalg.norm(np.cross(-r, to_sun), axis=-1)
    c = np.arctan2(cross, np.sum(-r * to_sun, axis=-1))
    # chord of the two circles: x from the Sun's centre towards the Earth's, half length y
    c_safe = np.maximum(c, 1e-12)
    x = (c_safe**2 + a**2 - b**2) / (2 * c_safe)
    y = np.sqrt(np.maximum(a**2 - x**2, 0.0))
    overlap = a**2 * np.arctan2(y, x) + b**2 * np.arctan2(y, c_safe - x) - c_safe * y
    partial = 1 - overlap / (np.pi * a**2)
    inside = np.where(b >= a, 0.0, 1 - (b / a) ** 2)
    fraction = np.where(c >= a + b, 1.0, np.where(c <= np.abs(b - a), inside, partial))
    return np.asarray(np.clip(fraction, 0.0, 1.0))
