"""Tiling craters for the Moon's ground below its map: slopes and brightness of a field saturated with impacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

SIZE = 1024
SLOPE_MAX = 0.9  # the slope channels hold plus and minus this
_SEED = 1969
_SMALLEST_PX = 4.0  # diameter
BROAD_LARGEST_PX, FINE_LARGEST_PX = 190.0, 45.0  # a tile often seen must have nothing that is known again
_COVER = 0.08  # N(> D) D^2: near the equilibrium of small craters (Gault 1970, Radio Science 5, 273)


def crater_texture(largest_px: float) -> ByteArray:
    """(SIZE, SIZE, 4): slope along u and v, brightness, unused; from the cache."""
    return cached_array(
        entry_name("craters", (make_craters,), float(largest_px)), lambda: make_craters(largest_px)
    )


def make_craters(largest_px: float) -> ByteArray:
    """The tile; numbers of craters fall with the square of their diameter, so that it serves at any scale."""
    rng = np.random.default_rng([_SEED, int(largest_px)])
    count = int(_COVER * SIZE**2 / _SMALLEST_PX**2)
    share = (np.arange(count) + rng.random(count)) / count
    diameters = np.minimum(_SMALLEST_PX / np.sqrt(1 - share), largest_px)
    height, bright = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    # the large ones are the old ones
    for diameter in diameters[::-1]:
        fresh = rng.random() ** 2
        _stamp(height, bright, rng.random(2) * SIZE, diameter / 2, fresh, rng.random(5) * 7)
    height += 0.7 * _rough(rng)
    du = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) / 2
    dv = (np.roll(height, -1, axis=0) - np.roll(height, 1, axis=0)) / 2
    channels = np.dstack(
        [
            0.5 + du / (2 * SLOPE_MAX),
            0.5 + dv / (2 * SLOPE_MAX),
            0.5 + np.clip(bright, -0.4, 0.5),
            np.ones_like(du),
        ]
    )
    return np.ascontiguousarray(np.clip(channels * 255 + 0.5, 0, 255).astype(np.uint8))


def _stamp(
    height: FloatArray, bright: FloatArray, at: FloatArray, radius: float, fresh: float, phases: FloatArray
) -> None:
    """One crater: a bowl a fifth as deep as wide when fresh, a rim, the ejecta's slope (Pike 1974, GRL 1, 291)."""
    reach = int(np.ceil(2.4 * radius)) + 1
    x0, y0 = int(at[0]) - reach, int(at[1]) - reach
    span = np.arange(2 * reach + 1)
    x, y = (x0 + span - at[0]) / radius, (y0 + span - at[1]) / radius
    # no crater is a circle
    turn = np.arctan2(y[:, None], x[None, :])
    swell = sum(
        0.09 / k * np.cos(k * (turn - phase)) for k, phase in zip((2, 3, 5, 7, 11), phases, strict=True)
    )
    r = np.hypot(x[None, :], y[:, None]) * (1 + swell)
    depth, rim = 0.36 * radius * (0.15 + 0.85 * fresh), 0.07 * radius * (0.3 + 0.7 * fresh)
    # the floors of large ones are flat, filled by what slid down
    inside = np.maximum((depth + rim) * r**2 - depth, -depth * (1 if radius < 20 else 0.62))
    outside = rim * np.maximum((2.4 - r) / 1.4, 0) ** 3
    # worn rims are round: the two meet over a tenth of the radius
    blend = np.clip((r - 1) / 0.16 + 0.5, 0, 1)
    shape = np.minimum(inside, rim) * (1 - blend) + outside * blend
    rows, columns = np.ix_((y0 + span) % SIZE, (x0 + span) % SIZE)
    if 2 * reach + 1 > SIZE:
        raise ValueError(f"a crater of radius {radius} px does not fit the tile")
    height[rows, columns] += shape
    bright[rows, columns] += 0.3 * fresh**2 * np.exp(-((r / 1.1) ** 2))


def _rough(rng: np.random.Generator) -> FloatArray:
    """Rolling ground between the craters, periodic."""
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None, :])
    f[0, 0] = 1
    field = np.fft.irfft2(
        np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * f**-1.7 * (f > 3 / SIZE), (SIZE, SIZE)
    )
    return np.asarray(field / field.std())
