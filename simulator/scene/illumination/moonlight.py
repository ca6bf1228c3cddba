"""Brightness of the Moon: albedo per band, phase function, and moonlight."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands

FULL_MOON_SHARE = 2.5e-6  # share of the Sun's irradiance: magnitudes -12.73 and -26.74, Allen (2000)
# Geometric albedo of the near side per band: 0.12 in V (Allen's Astrophysical Quantities 2000, table 12.8), other bands
# by the Moon's colours B-V = 0.92, V-R = 0.62 against the Sun's 0.65 and 0.35 (the same table)
_ALBEDO = {"panchromatic": 0.122, "red": 0.143, "green": 0.120, "blue": 0.096}
_SURGE, _SURGE_DEG = 0.33, 2.0  # excess at zero phase, and its e-folding phase angle


def moon_albedo(bands: Bands) -> FloatArray:
    """Return the Moon's geometric albedo per band.

    Returns
    -------
    (n,) array
        Geometric albedo of the near side, in the order of the image's channels.
    """
    return np.array([_ALBEDO[band.name] for band in bands_of(bands)])


def disc_phase(angle_rad: FloatArray | float) -> FloatArray:
    """Return the brightness of the whole disc relative to that at phase angle zero.

    Returns
    -------
    array
        Relative brightness 0 to 1, of the shape of ``angle_rad``; the sign of the angle is ignored.

    References
    ----------
    Allen's Astrophysical Quantities (2000), 12.5: V(alpha) = V(0) + 0.026 alpha + 4e-9 alpha^4, alpha in degrees.
    """
    degrees = np.degrees(np.abs(np.asarray(angle_rad, float)))
    return np.asarray(10 ** (-0.4 * (0.026 * degrees + 4.0e-9 * degrees**4)))


def moonlight_share(r_moon_m: FloatArray, sun: FloatArray) -> float:
    """Return the irradiance of the Moon's disc relative to the Sun's.

    Parameters
    ----------
    r_moon_m : (3,) array
        Vector to the Moon from the lit point.
    sun : (3,) array
        Unit vector to the Sun, same frame.

    Returns
    -------
    float
        Share of the Sun's irradiance, 0 to 1.
    """
    distance = float(np.linalg.norm(r_moon_m))
    phase = math.acos(min(max(float(-r_moon_m @ sun) / distance, -1.0), 1.0))
    return min(FULL_MOON_SHARE * float(disc_phase(phase)) * (384_400_000.0 / distance) ** 2, 1.0)


def lommel_seeliger_disc(angle_rad: FloatArray) -> FloatArray:
    """Return the disc-integrated Lommel-Seeliger law relative to zero phase: 1 - sin(a/2) tan(a/2) ln(cot(a/4))."""
    half = np.clip(np.abs(np.asarray(angle_rad, float)) / 2, 1e-6, np.pi / 2 - 1e-6)
    return np.asarray(1 - np.sin(half) * np.tan(half) * np.log(1 / np.tan(half / 2)))


def surface_phase(angle_rad: FloatArray) -> FloatArray:
    """Return the surface phase function for which a Lommel-Seeliger disc follows ``disc_phase``, with opposition surge.

    The surge is at phase angles that are visible from space, but from the Earth only in eclipse.

    Returns
    -------
    array
        Factor of the shape of ``angle_rad``: 1.33 at phase angle zero. Beyond 165 degrees it keeps its value there.

    References
    ----------
    Buratti, Hillier & Wang (1996), The lunar opposition surge: observations by Clementine, Icarus 124, 490: the ground
    at 0 degrees is 1.4 times as bright as at 4.
    """
    # beyond a phase angle of 165 degrees neither formula is valid, because relief dominates the crescent
    angle = np.clip(np.abs(np.asarray(angle_rad, float)), 0, np.radians(165))
    surge = 1 + _SURGE * np.exp(-np.degrees(angle) / _SURGE_DEG)
    return surge * disc_phase(angle) / lommel_seeliger_disc(angle)
