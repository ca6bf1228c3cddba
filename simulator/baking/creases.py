"""Tiling slopes of creased foil, with their deviation within each mipmap texel; mottle of matt surfaces.

Crumpling leaves sharp ridges around facets of all sizes: short ridges are log-normal, the longest a power law
(Andresen, Hansen & Schmittbuhl 2007, Ridge network in crumpled paper, Phys. Rev. E 76, 026108). Here a layer is the
upper or lower envelope of paraboloids, whose borders are straight (a power diagram): curved facets with a kink between
them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.baking.slope_levels import slope_levels
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

SIZE = 512  # texels along each side of the tile

SLOPE_MAX, DEVIATION_MAX = 1.0, 0.5
"""Full scale of the slope channels (plus and minus) and of the deviation channel."""

# Seed of the pattern; any fixed value serves.
_SEED = 1972
# facets in a tile, rms slope along each axis (alternately valleys and ridges), stretch and its direction [rad]
_LAYERS = ((40, 0.22, 1.5, 0.4), (150, -0.16, 1.7, 1.7), (700, 0.09, 1.4, 2.7), (3000, -0.035, 1.2, 1.0))

VARIANCE = 2 * sum(rms**2 for _, rms, *_ in _LAYERS)
"""Variance of the slopes, summed over both axes."""

# share of a facet's mean slope, and of its height, relative to those of its curvature
_TILT, _STEP = (
    0.8,
    0.9,
)
_MARGIN = 0.35  # share of the tile repeated around it
_MOTTLE_POWER = -1.4  # exponent of the mottle's amplitude over frequency
_BEND = 0.9  # standard deviation of the smoothing of creases [texels]
_FACET_VARIANCE = 4.0  # variance of the small facets relative to the mottle


def crease_levels() -> list[ByteArray]:
    """Return the levels of detail of the crease texture.

    Returns
    -------
    list of (S, S, 4) array
        Levels from the finest, 8 bits: slope along u and v, deviation of slopes within the texel, mottle.
    """
    slopes = cached_array(entry_name("creases", (make_creases,)), make_creases)
    levels = []
    for level, deviation in slope_levels(slopes):
        along_u, along_v = (0.5 + level[..., k] / (2 * SLOPE_MAX) for k in (0, 1))
        channels = np.dstack([along_u, along_v, deviation / DEVIATION_MAX, level[..., 2]])
        levels.append(np.clip(channels * 255 + 0.5, 0, 255).astype(np.uint8))
    return levels


def make_creases() -> FloatArray:
    """Return (SIZE, SIZE, 3) float32: slope along u and v; mottle, 0..1 about its mean of a half."""
    rng = np.random.default_rng(_SEED)
    place = (np.indices((SIZE, SIZE))[::-1].reshape(2, -1).T + 0.5) / SIZE
    layers = [_facets(rng, place, *layer).reshape(SIZE, SIZE, 2) for layer in _LAYERS]
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None, :])
    f[0, 0] = np.inf
    mottle = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * f**_MOTTLE_POWER, (SIZE, SIZE))
    level = 0.5 + np.clip(mottle / (6 * mottle.std()), -0.5, 0.5)
    level += 0.5 - level.mean()
    # some regions are smoother, others more crumpled
    uneven = np.sqrt(np.clip(1 + _FACET_VARIANCE * (np.roll(level, SIZE // 2, axis=0) - 0.5), 0.1, 2))[
        ..., None
    ]
    slopes = layers[0] + layers[1] + uneven * (layers[2] + layers[3])
    # blur: real creases are round
    soft = np.exp(-2 * (np.pi * _BEND * f) ** 2)
    soft[0, 0] = 1
    slopes = np.fft.irfft2(np.fft.rfft2(slopes, axes=(0, 1)) * soft[..., None], (SIZE, SIZE), axes=(0, 1))
    return np.dstack([slopes, level]).astype(np.float32)


def _facets(
    rng: np.random.Generator, place: FloatArray, count: int, rms: float, stretch: float, turn: float
) -> FloatArray:
    """Return (P, 2) slopes of one layer at points (P, 2) of the tile.

    Paraboloid i is ``|x - s_i|^2 + w_i``, where its tilt has moved its centre s_i. The lowest one is the nearest point
    in three dimensions, with the root of w_i as the third coordinate.
    """
    radius = 0.5 / np.sqrt(count)
    middle = rng.random((count, 2))
    tilted_centre = middle + _TILT * radius * rng.standard_normal((count, 2))
    rise = _STEP * radius**2 * rng.random(count)
    around = np.concatenate([tilted_centre + np.array([i, j]) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    depth = np.tile(np.sqrt(rise), 9)
    near = (np.abs(around - 0.5) < 0.5 + _MARGIN).all(axis=1)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    longer = along.T @ np.diag([stretch, 1 / stretch]) @ along
    tree = cKDTree(np.column_stack([around[near] @ longer, depth[near]]))
    _, which = tree.query(np.column_stack([place @ longer, np.zeros(len(place))]))
    slopes = (place - around[near][which]) @ longer @ longer
    return np.asarray(slopes * (rms / np.sqrt((slopes**2).mean())))
