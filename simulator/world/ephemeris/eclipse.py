"""Eclipses: the fraction of the Sun's disc that is visible past spherical and ellipsoidal bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import EARTH_RADIUS_M, FLATTENING, SUN_RADIUS_M

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.body import BodyState

GCRS_POLE = (0.0, 0.0, 1.0)
"""The Earth's axis at J2000.0. The axis of 2026 is a sixth of a degree away, which moves the limb by 60 m."""
# The body's limb cannot reach the Sun's disc if the directions from the body to the craft and from the craft to the Sun
# have a cosine above this: the sine of the Sun's angular radius, 0.0047 at 1 au, doubled.
_DAY_SIDE_COSINE = 0.01


def sun_fraction_past_bodies(
    bodies: Iterable[BodyState], r_eci_m: ArrayLike, r_sun_eci_m: ArrayLike
) -> float:
    """Compute the fraction of the Sun's disc that is visible from a spacecraft past all bodies.

    The hidden fractions are added. From a low orbit two bodies overlap in front of the Sun for some 20 s a year; the
    hidden part is then counted twice.

    Parameters
    ----------
    bodies : iterable of BodyState
        States of the bodies.
    r_eci_m : array_like
        (3,) position of the spacecraft from the Earth's centre [m].
    r_sun_eci_m : array_like
        (3,) position of the Sun from the Earth's centre [m].

    Returns
    -------
    float
        Visible fraction, 0 to 1.
    """
    r, sun = (np.asarray(x, float) for x in (r_eci_m, r_sun_eci_m))
    return max(float(add_shares([sun_fraction_past_body(state, r, sun) for state in bodies])), 0.0)


def sun_fraction_past_body(state: BodyState, r_eci_m: FloatArray, r_sun_eci_m: FloatArray) -> FloatArray:
    """Return the fraction of the Sun's disc visible past one body; arguments as for `sun_fraction_past_earth`.

    Returns
    -------
    (...) array
        Fraction, 0 to 1: 1 in sunlight, 0 in umbra. The body is a sphere if its flattening is 0, else an ellipsoid.
    """
    body, centre = state.body, np.asarray(state.r_eci_m)
    r, sun = r_eci_m - centre, r_sun_eci_m - centre
    if not body.flattening:
        return sun_fraction_past_sphere(r, sun, body.radius_m)
    return _past_ellipsoid(r, sun, state.R_fixed_from_eci[2], body.radius_m, body.flattening)


def add_shares(shares: Sequence[FloatArray]) -> FloatArray:
    """Combine the visible fractions past each of several bodies.

    Returns
    -------
    (...) array
        1 minus the sum of the hidden fractions, at most 1. It is too low where bodies overlap in front of the Sun,
        and possibly negative; callers clip it. With a single body it is the given array itself.
    """
    total = shares[0]
    for share in shares[1:]:
        total = total + share - 1.0
    return total


def sun_fraction_past_earth(
    r_eci_m: ArrayLike, r_sun_eci_m: ArrayLike, pole_eci: ArrayLike = GCRS_POLE
) -> FloatArray:
    """Return the fraction of the Sun's disc not hidden by the Earth's ellipsoid (WGS 84): 1 in sunlight, 0 in umbra.

    Parameters
    ----------
    r_eci_m : array_like
        (..., 3) position of the spacecraft from the Earth's centre [m].
    r_sun_eci_m : array_like
        (..., 3) position of the Sun from the Earth's centre [m].
    pole_eci : array_like, optional
        (3,) unit vector of the Earth's axis.

    Returns
    -------
    (...) array
        Fraction, 0..1.
    """
    r, sun, pole = (np.asarray(x, float) for x in (r_eci_m, r_sun_eci_m, pole_eci))
    return _past_ellipsoid(r, sun, pole, EARTH_RADIUS_M, FLATTENING)


def _past_ellipsoid(
    r: FloatArray, sun: FloatArray, pole: FloatArray, radius_m: float, flattening: float
) -> FloatArray:
    """Return the visible fraction past an ellipsoid.

    Space is stretched along the ellipsoid's axis, so that it becomes a sphere and rays stay straight. This elongates
    the Sun's disc (by 0.003 for the Earth), which is neglected.
    """
    stretch = 1 / (1 - flattening) - 1
    r, sun = (x + (stretch * np.asarray(x @ pole))[..., None] * pole for x in (r, sun))
    return sun_fraction_past_sphere(r, sun, radius_m)


def sun_fraction_past_sphere(r_m: ArrayLike, r_sun_m: ArrayLike, radius_m: float) -> FloatArray:
    """Return the fraction of the Sun's disc not hidden by a spherical body: 1 in sunlight, 0 in umbra.

    The overlap is that of two plane circles with the bodies' angular radii. Absorption and refraction in an atmosphere
    are neglected.

    Parameters
    ----------
    r_m : array_like
        (..., 3) position of the spacecraft from the body's centre [m].
    r_sun_m : array_like
        (..., 3) position of the Sun from the body's centre [m].
    radius_m : float
        Radius of the body.

    Returns
    -------
    (...) array
        Fraction, 0..1.

    References
    ----------
    Montenbruck & Gill (2000), Satellite Orbits (shadow function).
    """
    # by components: for a single position this is faster than NumPy's cross product and norms
    x, y, z = (np.asarray(r_m, float)[..., k] for k in range(3))
    sx, sy, sz = (np.asarray(r_sun_m, float)[..., k] - centre for k, centre in enumerate((x, y, z)))
    distance = np.sqrt(x * x + y * y + z * z)
    sun_distance = np.sqrt(sx * sx + sy * sy + sz * sz)
    along_sun = -(x * sx + y * sy + z * sz)
    if np.all(along_sun < -_DAY_SIDE_COSINE * distance * sun_distance):
        return np.ones(np.shape(distance))
    across_sun = np.sqrt((y * sz - z * sy) ** 2 + (z * sx - x * sz) ** 2 + (x * sy - y * sx) ** 2)
    a = np.arcsin(SUN_RADIUS_M / sun_distance)
    b = np.arcsin(np.minimum(radius_m / distance, 1.0))
    c = np.arctan2(across_sun, along_sun)
    # chord of the two circles: distance of its midpoint from the Sun's centre, and half its length
    c_safe = np.maximum(c, 1e-12)
    middle = (c_safe**2 + a**2 - b**2) / (2 * c_safe)
    half_chord = np.sqrt(np.maximum(a**2 - middle**2, 0.0))
    sectors = a**2 * np.arctan2(half_chord, middle) + b**2 * np.arctan2(half_chord, c_safe - middle)
    overlap = sectors - c_safe * half_chord
    partial = 1 - overlap / (np.pi * a**2)
    annular = np.where(b >= a, 0.0, 1 - (b / a) ** 2)
    fraction = np.where(c >= a + b, 1.0, np.where(c <= np.abs(b - a), annular, partial))
    return np.asarray(np.clip(fraction, 0.0, 1.0))
