"""Sunlight through the Earth's limb: dimmed, reddened and refracted into the shadow; the Sun's limb darkening.

The same model gives the Sun seen past the Earth and the light inside the Earth's shadow on the Moon. At a distance D
behind the Earth, a refracted ray of perigee height h arrives where a straight ray of perigee height y = h - D e(h)
would, where e(h) is the refraction angle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.atmosphere import earth_atmosphere, optical_depth_to_top
from flyaround.simulator.world.constants import SUN_RADIUS_M

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands

# through the whole air along the ground: twice the 34.5' of a setting Sun
BENDING_RAD = np.radians(69.0 / 60)
BENDING_HEIGHT_M = 8000.0  # scale height of the bending, that of the density
LIMB_DARKENING = 0.6  # linear law in the visible: Allen's Astrophysical Quantities (2000), 14.7

# Perigee heights of the tabulated rays [m].
_HEIGHTS_M = np.concatenate([np.linspace(0, 60e3, 601), np.linspace(62e3, 300e3, 120)])
_STRIPS = 96  # strips of the Sun's disc


def limb_darkening(share_of_radius: FloatArray) -> FloatArray:
    """Return the radiance of the Sun's disc relative to its mean, at a share 0..1 of its radius."""
    mu = np.sqrt(np.clip(1 - np.asarray(share_of_radius, float) ** 2, 0, None))
    return (1 - LIMB_DARKENING * (1 - mu)) / (1 - LIMB_DARKENING / 3)


@lru_cache(maxsize=4)
def _grazing(bands: Bands) -> FloatArray:
    """Return the transmittance (K, n) of the whole air along rays of perigee height ``_HEIGHTS_M``."""
    air = earth_atmosphere(bands)
    depth = optical_depth_to_top(air, air.radius_m + _HEIGHTS_M, np.zeros_like(_HEIGHTS_M), steps=48)
    # clouds block most of the low rays: the transmittance increases from a tenth at the ground to one at 12 km
    clear = 0.1 + 0.9 * np.clip(_HEIGHTS_M / 12e3, 0, 1)
    return np.exp(-2 * depth) * clear[:, None]


@lru_cache(maxsize=1)
def _strips() -> tuple[FloatArray, FloatArray]:
    """Return the strips of the disc: position -1..1 and share of the light."""
    edges = -np.cos(np.linspace(0, np.pi, _STRIPS + 1))  # fine at both ends
    position = 0.5 * (edges[1:] + edges[:-1])
    half = np.sqrt(1 - position**2)
    # brightness integrated along a strip; closed form of 1 - u + u sqrt(1 - r^2) along a chord of half length c
    light = 2 * half * (1 - LIMB_DARKENING) + LIMB_DARKENING * np.pi / 2 * half**2
    weight = light * np.diff(edges)
    return position, weight / weight.sum()


def sunlight_past_earth(r_m: FloatArray, r_sun_m: FloatArray, bands: Bands) -> FloatArray:
    """Return the share (n,) of sunlight per band that reaches a position past the Earth and through its air.

    Parameters
    ----------
    r_m : (3,) array
        Position from the Earth's centre, in space stretched so that the ellipsoid is a sphere [m].
    r_sun_m : (3,) array
        Position of the Sun, in the same space [m].
    bands : Bands
        Spectral bands of the image.

    Returns
    -------
    (n,) array
        Share per band, 0 to 1.
    """
    air = earth_atmosphere(bands)
    to_sun = np.asarray(r_sun_m, float) - r_m
    height_m = float(np.linalg.norm(to_sun))
    u = to_sun / height_m
    behind = -float(np.dot(r_m, u))  # distance behind the Earth's centre
    if behind <= 0:
        return np.ones(len(air.rayleigh_m))
    # height of the straight ray from the Sun's centre
    y = float(np.linalg.norm(r_m + behind * u)) - air.radius_m
    sun_m = behind * SUN_RADIUS_M / height_m
    if y - sun_m > _HEIGHTS_M[-1]:
        return np.ones(len(air.rayleigh_m))
    position, weight = _strips()
    bending = BENDING_RAD * np.exp(-_HEIGHTS_M / BENDING_HEIGHT_M)
    arrives = _HEIGHTS_M - behind * bending
    light = _grazing(bands) / (1 + behind * bending / BENDING_HEIGHT_M)[:, None]
    position_m = y + sun_m * position
    return np.array([weight @ np.interp(position_m, arrives, column, left=0.0) for column in light.T])


@lru_cache(maxsize=8)
def shadow_profile(distance_km: int, sun_distance_gm: int, bands: Bands) -> tuple[FloatArray, float]:
    """Compute the sunlight across the Earth's shadow far behind it, including light refracted around the whole limb.

    Parameters
    ----------
    distance_km : int
        Distance behind the Earth.
    sun_distance_gm : int
        Distance of the Sun from there [10^9 m].
    bands : Bands
        Spectral bands of the image.

    Returns
    -------
    share : (256, n) share of the unobstructed light per band, at uniform steps from the axis.
    reach_m : distance of the last one from the axis, where it is one.
    """
    air = earth_atmosphere(bands)
    behind = distance_km * 1e3
    sun_m = behind * SUN_RADIUS_M / (sun_distance_gm * 1e9)
    reach = air.radius_m + 1.15 * sun_m + 300e3
    # rings in the plane of the limb are mapped to where their light arrives, which conserves light, also at the axis
    h = np.concatenate([np.linspace(0, 300e3, 6001), np.linspace(300e3, reach + sun_m, 4000)[1:]])
    middle, width = 0.5 * (h[1:] + h[:-1]), np.diff(h)
    arrival = np.abs(air.radius_m + middle - behind * BENDING_RAD * np.exp(-middle / BENDING_HEIGHT_M))
    flux = width * 2 * np.pi * (air.radius_m + middle)
    through = np.stack([np.interp(middle, _HEIGHTS_M, c, right=1.0) for c in _grazing(bands).T], axis=1)
    edges = np.linspace(0, reach + sun_m, 1201)
    area = np.pi * np.diff(edges**2)
    point = np.stack([np.histogram(arrival, edges, weights=flux * c)[0] / area for c in through.T], axis=1)
    radius = 0.5 * (edges[1:] + edges[:-1])
    # the disc of the Sun, as a plane of rays from each of its parts
    ring = (np.arange(16) + 0.5) / 16
    turn = (np.arange(48) + 0.5) / 48 * np.pi
    s, a = (v.ravel() for v in np.meshgrid(np.sqrt(ring), turn))
    weight = limb_darkening(s)
    weight = weight / weight.sum()
    axis = np.linspace(0, reach, 256)
    far = np.sqrt(axis[:, None] ** 2 + (sun_m * s) ** 2 + 2 * axis[:, None] * (sun_m * s * np.cos(a)))
    share = np.stack([(np.interp(far, radius, c, right=1.0) * weight).sum(axis=1) for c in point.T], axis=1)
    return np.clip(share, 0, 1), reach
