"""City lights finer than the texels of the night map: streets, towns and roads, as a tiling texture of mean one.

The same texture holds the cloud detail, so that regions without sunlight and moonlight need a single texture fetch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.detail_noise import SIZE, detail_texture, make_detail
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray, IntArray

MAX_LIGHT = 16.0  # largest value of the light channels, as a multiple of their mean

MAP_MAX_W_M2_SR = 7.0e-4
"""Radiance of the brightest texel of the night map: 70 nW cm-2 sr-1 over its 5 km, in the band of VIIRS.

The map is an image of Suomi NPP's day-night band of 2012. With this value, areas of 50 km around the largest cities
emit 25 to 60 nW cm-2 sr-1, in agreement with Elvidge et al. (2017), Int. J. Remote Sensing 38, 5860.
"""

# Seed of the pattern; any fixed value serves.
_SEED = 20120401
_TILE = SIZE // 2  # size of the pattern [texels], repeated twice each way
# cells along the pattern's side: districts with one street direction, and meshes of main roads
_DISTRICTS, _TOWNS = 44, 15
_VILLAGES = 1 / 90  # villages per texel: one in 5 km2
_BLOCKS = (3, 6)  # texels between streets: 0.7 to 1.2 km; smaller streets merge into the glow


def night_texture() -> ByteArray:
    """Return the tiling texture of the night side.

    Returns
    -------
    (SIZE, SIZE, 4) array
        8-bit channels: cloud detail as in `detail_texture`, city light, village light, share of white lamps. From the
        cache.
    """
    return cached_array(entry_name("night", (make_night, make_detail)), make_night)


def make_night() -> ByteArray:
    """Return the cloud detail (from the cache), and the light over its mean, up to ``MAX_LIGHT``."""
    return np.dstack([detail_texture()[..., :1], np.tile(make_city_lights(), (2, 2, 1))])


def make_city_lights() -> ByteArray:
    """Return (_TILE, _TILE, 3): cities with centres and parks, country with towns and roads, share of white lamps."""
    # Widths are in texels of 0.23 km; weights are relative, because each channel is divided by its mean. All are chosen
    # by eye: only the mean over 50 km, `MAP_MAX_W_M2_SR`, is measured.
    rng = np.random.default_rng(_SEED)
    quarter, border = _cells(rng, _DISTRICTS, 2.5)
    town, road = _cells(rng, _TOWNS, 5.0)
    shape = quarter.shape
    y, x = np.indices(shape, np.float32)
    count = int(quarter.max()) + 1
    turn, block = rng.uniform(0, np.pi / 2, count), rng.integers(*_BLOCKS, count)
    cosine, sine, step = (a[quarter].astype(np.float32) for a in (np.cos(turn), np.sin(turn), block))
    streets = np.maximum(_ridge(x * cosine + y * sine, step), _ridge(y * cosine - x * sine, 1.5 * step))
    # crossings, squares, malls: few texels hold such a point of light
    points = rng.lognormal(-0.7, 1.2, shape)
    parks = np.clip(0.9 + 0.9 * _normal(rng, shape, 3.0), 0.0, 1.0)  # a sixth is dark
    avenues, main_roads = (np.exp(-((distance / w) ** 2)) for distance, w in ((border, 0.8), (road, 0.9)))
    built = (
        parks * _soft(rng.lognormal(0.0, 0.6, count)[quarter], 1.2) * (0.1 + streets * (0.2 + 0.6 * points))
    )
    centres = _towns(rng, quarter, 0.8, 1.6) * (0.4 + points)
    town_light = np.minimum(_towns(rng, town, 0.5, 6.0), 3.0)
    city = (
        built * (0.8 + 0.7 * town_light)
        + avenues * (0.2 + 0.25 * town_light)
        + main_roads
        + 0.3 * np.minimum(centres, 8.0)
    )
    villages = (rng.random(shape) < _VILLAGES) * rng.lognormal(0.0, 1.0, shape) * np.exp(-road / 12.0)
    country = (
        (0.3, 0.8 * _soft(villages, 0.5) + 0.2 * _soft(villages, 1.6)),
        (0.35, _towns(rng, town, 1.0, 3.5) * (0.25 + streets * (0.3 + points)) * parks),
        (0.25, _towns(rng, quarter, 1.3, 0.7) * (0.4 + points)),
        (0.1, main_roads * (1.0 + points)),
    )
    out = np.empty((*shape, 3), np.uint8)
    for k, light in enumerate((city, sum(share * part / part.mean() for share, part in country))):
        light = _soft(light, 0.4)  # noqa: PLW2901 - step by step
        # clip at the largest stored value and rescale, repeatedly, so that the clipped field has a mean of one
        for _ in range(8):
            light = np.minimum(light / light.mean(), MAX_LIGHT)  # noqa: PLW2901 - step by step
        # stochastic rounding keeps the mean of dark regions
        out[..., k] = np.minimum(light * (255 / MAX_LIGHT) + rng.random(shape), 255)
    white = 0.5 + 0.22 * _normal(rng, shape, 5.0) + 0.22 * _normal(rng, shape, 1.0)
    out[..., 2] = np.clip(white, 0, 1) * 255
    return out


def _towns(rng: np.random.Generator, cells: IntArray, spread: float, texels: float) -> Float32Array:
    """Return the light of towns where three cells meet, over its mean; brighter towns are wider.

    Parameters
    ----------
    rng : Generator
        Random generator.
    cells : (N, N) array
        Index of the Voronoi cell of each texel.
    spread : float
        Standard deviation of the logarithm of a town's light.
    texels : float
        Width of a median town.
    """
    neighbours = np.sort(
        [np.roll(cells, shift, (0, 1)) for shift in ((0, 0), (1, 0), (0, 1), (1, 1))], axis=0
    )
    light = ((np.diff(neighbours, axis=0) != 0).sum(axis=0) >= 2) * rng.lognormal(0.0, spread, cells.shape)
    out = np.zeros(cells.shape, np.float32)
    # hamlets, towns and cities: each a wide glow and a centre of 0.4 of its width, of equal light
    for low, high, wide in ((0.0, 0.7, 0.5), (0.7, 2.0, 1.0), (2.0, np.inf, 2.0)):
        same_cell = light * ((light >= low) & (light < high))
        out += _soft(same_cell, texels * wide) + _soft(same_cell, 0.4 * texels * wide)
    return np.asarray(out / out.mean(), np.float32)


def _ridge(across: Float32Array, step: Float32Array) -> Float32Array:
    """Return 1 on lines one step apart, falling to 0 within a texel or two."""
    distance = np.abs(across - step * np.round(across / step))
    # narrower lines break into dots
    return np.asarray(np.exp(-((distance / 0.6) ** 2)), np.float32)


def _cells(rng: np.random.Generator, count: int, bend: float) -> tuple[IntArray, Float32Array]:
    """Return (index, distance to the border [texels]) of periodic Voronoi cells of ``count^2`` jittered points.

    Parameters
    ----------
    rng : Generator
        Random generator.
    count : int
        Number of cells along each side.
    bend : float
        Amplitude of the distortion of straight borders [texels].
    """
    pad, spacing = _TILE // 4, _TILE / count
    cell = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1)
    x, y = np.moveaxis(((cell + rng.random((count, count, 2))) * spacing).astype(int), -1, 0)
    number = np.zeros((_TILE, _TILE), np.int64)
    number[y, x] = np.arange(count * count).reshape(count, count)
    seed = np.zeros((_TILE, _TILE), bool)
    seed[y, x] = True
    wrapped = np.pad(seed, pad, mode="wrap")
    _, nearest = cv2.distanceTransformWithLabels(
        (~wrapped).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    cells = np.append(0, np.pad(number, pad, mode="wrap")[wrapped])[nearest]
    y, x = np.indices((_TILE, _TILE))
    bent_rows_columns = (
        np.rint(k + bend * _normal(rng, (_TILE, _TILE), 3 * bend)).astype(int) % _TILE + pad for k in (y, x)
    )
    cells = np.pad(cells[tuple(bent_rows_columns)], pad, mode="wrap")
    edge = (cells != np.roll(cells, 1, 0)) | (cells != np.roll(cells, 1, 1))
    border = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inner = slice(pad, -pad)
    return cells[inner, inner], np.asarray(border[inner, inner], np.float32)


def _normal(rng: np.random.Generator, shape: tuple[int, int], texels: float) -> Float32Array:
    """Return periodic noise of unit standard deviation, correlated over ``texels``."""
    noise = _soft(rng.standard_normal(shape), texels)
    return np.asarray(noise / noise.std(), np.float32)


def _soft(image: FloatArray, texels: float) -> Float32Array:
    """Blur periodically."""
    pad = int(4 * texels) + 4
    wrapped = np.pad(image.astype(np.float32), pad, mode="wrap")
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), texels)[pad:-pad, pad:-pad], np.float32)
