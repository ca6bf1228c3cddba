"""Tiling craters for the Moon's ground below its map: slopes and brightness of a field saturated with impacts.

Each crater is the profile of a fresh one after topographic diffusion, from a sharp bowl with bright ejecta to a shallow
dish (Fassett & Thomson 2014, Crater degradation on the lunar maria, JGR Planets 119, 2255).
The ground is in equilibrium: craters are eroded as fast as new ones form. Ages are therefore uniform over a crater's
lifetime, and the cumulative number falls with the square of the diameter (Minton et al. 2019, Icarus 326, 63).
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.slope_levels import slope_levels
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

# Side of the texture [texels].
SIZE = 1024
# full scale of the slope channels (plus and minus), and of the channel of their deviation
SLOPE_MAX, DEVIATION_MAX = 0.9, 0.5

# Seed of the pattern; any fixed value serves.
_SEED = 1969
_MIN_DIAMETER_PX = 4.0  # diameter
# largest diameters: a larger crater would make the repetition of the tile visible
BROAD_MAX_PX, FINE_MAX_PX = 190.0, 45.0
_EQUILIBRIUM_COVERAGE = (
    0.12  # N(> D) D^2: near the equilibrium of small craters (Gault 1970, Radio Science 5, 273)
)
_COMPLEX_KM = 17.0  # diameter beyond which floors are flat (Pike 1977)
# extent of profiles during diffusion and when stamped, and spacing of their nodes [radii]
_PROFILE_RADII, _STAMP_RADII, _NODE_SPACING = 4.0, 2.8, 0.04
_EROSION_SIMPLE = 0.7  # diffusivity times time over the radius squared after which 0.07 of the depth is left
_EROSION_COMPLEX = 0.1  # the same for large craters, which smaller impacts erode faster than diffusion does
_STATES = 24  # tabulated stages of a crater's erosion
_PERSISTENT_KM = 8.0  # diameter of craters that outlast the ground's age
_SHARP_PX = 0.6  # standard deviation of the anti-aliasing blur
_BRIGHT_SHARE = 0.1  # share of its lifetime for which a crater's ejecta stay brighter than old ground
# share of the lifetime with visible rays; minimum radius with rays; their length [radii]
_RAY_SHARE, _MIN_RAYED_RADIUS_PX, _RAY_RADII = 0.03, 5.0, 7.0


def crater_texture(largest_px: float, texel_km: float) -> ByteArray:
    """Return (SIZE, SIZE, 4): slope along u and v, brightness, unused; from the cache."""
    return cached_array(
        entry_name("craters", (make_craters,), float(largest_px), float(texel_km)),
        lambda: make_craters(largest_px, texel_km),
    )


def crater_levels(largest_px: float, texel_km: float) -> list[ByteArray]:
    """Return all mipmap levels of the tile of craters.

    Returns
    -------
    list of (n, n, 4) array
        8-bit levels, the finest first, with channels as in `crater_texture`; the last channel holds the deviation of
        slopes within a texel, `DEVIATION_MAX` at full scale.
    """
    tile = crater_texture(largest_px, texel_km) / np.float32(255)
    tile[..., :2] = (tile[..., :2] - 0.5) * (2 * SLOPE_MAX)
    levels = []
    for level, deviation in slope_levels(tile):
        slopes = level[..., :2] / (2 * SLOPE_MAX) + 0.5
        channels = np.dstack([slopes, level[..., 2], deviation / DEVIATION_MAX])
        levels.append(np.clip(channels * 255 + 0.5, 0, 255).astype(np.uint8))
    return levels


def make_craters(largest_px: float, texel_km: float) -> ByteArray:
    """Make the tile.

    Parameters
    ----------
    largest_px : float
        Diameter of the largest crater [px].
    texel_km : float
        Size of a texel: large craters are shallower [km].
    """
    rng = np.random.default_rng([_SEED, int(largest_px)])
    count = int(_EQUILIBRIUM_COVERAGE * SIZE**2 / _MIN_DIAMETER_PX**2)
    share = (np.arange(count) + rng.random(count)) / count
    diameters = np.minimum(_MIN_DIAMETER_PX / np.sqrt(1 - share), largest_px)
    age = rng.random(count)  # as a share of the lifetime, which grows with the diameter
    # large craters have not reached equilibrium: the ground is as old as 0.6 of their lifetime; chosen by eye
    age *= np.where(diameters * texel_km < _PERSISTENT_KM, 1.0, 0.6)
    # fewer old craters than uniform ages have; chosen by eye
    age **= 1.25
    # rolling ground below and above the craters, in texels of height; chosen by eye, as brightness below
    rough = _rough(rng)
    height, bright = 0.7 * rough, np.zeros((SIZE, SIZE))
    for k in np.argsort(-age * diameters):
        _stamp(height, bright, rng, diameters[k] / 2, age[k], texel_km)
    height += 0.4 * np.roll(rough, SIZE // 2)
    du = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) / 2
    dv = (np.roll(height, -1, axis=0) - np.roll(height, 1, axis=0)) / 2
    # material sliding down slopes exposes fresh, brighter ground
    bright += 0.35 * np.minimum(du**2 + dv**2, 0.3)
    channels = np.dstack(
        [
            0.5 + du / (2 * SLOPE_MAX),
            0.5 + dv / (2 * SLOPE_MAX),
            0.5 + np.clip(bright - bright.mean(), -0.4, 0.5),
            np.ones_like(du),
        ]
    )
    return np.ascontiguousarray(np.clip(channels * 255 + 0.5, 0, 255).astype(np.uint8))


def fresh_profile(r: FloatArray, diameter_km: float) -> FloatArray:
    """Return the height of a fresh crater at distances in radii, over its radius.

    References
    ----------
    Pike (1977), Size-dependence in the shape of fresh impact craters on the Moon: depth and height of the rim.
    McGetchin, Settle & Head (1973), EPSL 20, 226: ejecta thin with the cube of the distance.
    """
    simple = diameter_km < _COMPLEX_KM
    depth = 0.196 * diameter_km**1.01 if simple else 1.044 * diameter_km**0.301
    rim = 0.036 * diameter_km**1.014 if simple else 0.236 * diameter_km**0.399
    depth, rim = 2 * depth / diameter_km, 2 * rim / diameter_km
    # a paraboloid, or walls from 0.74 radii outwards around a flat floor with a central peak
    bowl = np.maximum(depth * (r**2 if simple else 2.2 * r**2 - 1.2) - depth + rim, rim - depth)
    peak = 0.0 if simple else 0.3 * depth * np.exp(-((r / 0.16) ** 2))
    return np.asarray(np.where(r < 1, bowl + peak, rim * np.maximum(r, 1) ** -3.0))


@lru_cache(maxsize=64)
def eroded_profiles(diameter_km: float) -> FloatArray:
    """Return (STATES, N) heights over the radius in evenly spaced erosion stages; node k is at ``k _NODE_SPACING``."""
    r = np.arange(0, _PROFILE_RADII + _NODE_SPACING / 2, _NODE_SPACING)
    last = _EROSION_SIMPLE if diameter_km < _COMPLEX_KM else _EROSION_COMPLEX
    # explicit steps are stable up to a number of 0.25 in two dimensions
    steps = int(np.ceil(last / (0.2 * _NODE_SPACING**2 * (_STATES - 1))))
    gain = last / ((_STATES - 1) * steps) / _NODE_SPACING**2
    h, out = fresh_profile(r, diameter_km), []
    for _ in range(_STATES):
        out.append(h)
        for _ in range(steps):
            rise = np.diff(h)
            outwards = (r[:-1] + _NODE_SPACING / 2) * rise
            h = h.copy()
            h[1:-1] += gain * np.diff(outwards) / r[1:-1]
            h[0] += 4 * gain * rise[0]
    # subtract the value at the stamp's edge, to avoid a step there
    return np.array(out) * np.clip(_STAMP_RADII - r, 0, 1)


def _stamp(
    height: FloatArray,
    bright: FloatArray,
    rng: np.random.Generator,
    radius: float,
    age: float,
    texel_km: float,
) -> None:
    """Add one crater, and erase the terrain under its bowl and ejecta."""
    diameter_km = 2 * radius * texel_km
    # simple craters have one shape; complex ones are tabulated every 5 km
    kind = 1.0 if diameter_km < _COMPLEX_KM else max(5.0 * round(diameter_km / 5), _COMPLEX_KM)
    centre, phases = rng.random(2) * SIZE, rng.random(5) * 7
    # rays longer than the tile would overlap themselves
    rayed = age < _RAY_SHARE and _MIN_RAYED_RADIUS_PX < radius < 0.45 * SIZE / _RAY_RADII
    extent = int(np.ceil((_RAY_RADII if rayed else _STAMP_RADII) * radius)) + 1
    if 2 * extent + 1 > SIZE:
        raise ValueError(
            f"a crater of radius {radius} px does not fit the tile of {SIZE} px; make it smaller"
        )
    x0, y0 = int(centre[0]) - extent, int(centre[1]) - extent
    span = np.arange(2 * extent + 1)
    x, y = (x0 + span - centre[0]) / radius, (y0 + span - centre[1]) / radius
    turn = np.arctan2(y[:, None], x[None, :])
    # real craters are not circular: modes of a few per cent, weaker towards fine ones
    swell = sum(
        0.09 / k * np.cos(k * (turn - phase)) for k, phase in zip((2, 3, 5, 7, 11), phases, strict=True)
    )
    r = np.hypot(x[None, :], y[:, None]) * (1 + swell)
    profiles = eroded_profiles(kind)
    last = _EROSION_SIMPLE if kind < _COMPLEX_KM else _EROSION_COMPLEX
    state = min(age + 0.5 * (_SHARP_PX / radius) ** 2 / last, 1.0) * (_STATES - 1)
    lower = min(int(state), _STATES - 2)
    profile = profiles[lower] + (state - lower) * (profiles[lower + 1] - profiles[lower])
    nodes = np.arange(profiles.shape[1]) * _NODE_SPACING
    rows, columns = np.ix_((y0 + span) % SIZE, (x0 + span) % SIZE)
    region = height[rows, columns]
    # whole up to 0.9 radii, nothing from 1.5 on, where ejecta are thin
    erased = np.clip((1.5 - r) / 0.6, 0, 1)
    # blend towards the local plane of the old ground
    level = (region * erased).sum() / erased.sum()
    plane = level + sum(d * (region * erased * d).sum() / (erased * d * d).sum() for d in (x, y[:, None]))
    height[rows, columns] = region + erased * 0.9 * (plane - region) + radius * np.interp(r, nodes, profile)
    # bright ejecta over 1.5 radii, and rays in a few directions; chosen by eye
    young = max(1 - age / _BRIGHT_SHARE, 0.0)
    light = 0.3 * young**2 * np.exp(-((r / 1.5) ** 2))
    if rayed:
        spokes = sum(np.cos(k * turn + p) for k, p in zip((3, 7, 12, 19), phases, strict=False)) / 4
        light += (
            0.35
            * (1 - age / _RAY_SHARE)
            * np.clip(0.2 + spokes, 0, 1)
            * np.clip(1 - r / _RAY_RADII, 0, 1) ** 2
        )
    bright[rows, columns] = np.maximum(bright[rows, columns] * (1 - erased), light)


def _rough(rng: np.random.Generator) -> FloatArray:
    """Return rolling ground between the craters, periodic, from a third of the tile down, of unit deviation."""
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None, :])
    f[0, 0] = 1
    field = np.fft.irfft2(
        np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * f**-1.7 * (f > 3 / SIZE), (SIZE, SIZE)
    )
    return np.asarray(field / field.std())
