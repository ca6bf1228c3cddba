"""City lights below the night map's texels: streets and villages of a mean of one, baked once into a tiling texture.

The clouds' puffs lie beside them in its channels: where neither Sun nor Moon shine one look-up serves for both.
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

BRIGHTEST = 12.0  # times the mean: what the light's channel holds
MAP_MAX_W_M2_SR = 7.0e-4
"""Radiance of a texel of the night map at its brightest, 70 nW cm-2 sr-1 over its 5 km, in the band of VIIRS.

The map is a picture of Suomi NPP's day-night band of 2012. With this figure 50 km around the largest cities send 25 to
60 nW cm-2 sr-1, as Elvidge et al. (2017, Int. J. Remote Sensing 38, 5860) map them.
"""
_SEED = 20120401
_TILE = SIZE // 2  # texels of the pattern, repeated twice each way
_DISTRICTS, _TOWNS = 44, 15  # cells along its side: of one direction of streets, and between main roads
_VILLAGES = 1 / 90  # of the texels: one in 5 km2
_BLOCKS = (3, 6)  # texels between streets: 0.7 to 1.2 km; smaller streets in between are the glow


def night_texture() -> ByteArray:
    """(SIZE, SIZE, 4) puffs of cloud as in `detail_texture`, light of cities and of villages, share of white lamps."""
    return cached_array(entry_name("night", (make_night, make_detail)), make_night)


def make_night() -> ByteArray:
    """The clouds' puffs; light over its mean, up to ``BRIGHTEST``; from the cache where it has them."""
    return np.dstack([detail_texture()[..., :1], np.tile(make_city_lights(), (2, 2, 1))])


def make_city_lights() -> ByteArray:
    """(_TILE, _TILE, 3) cities: streets turned from district to district, parks, main roads; villages; white lamps."""
    rng = np.random.default_rng(_SEED)
    district, border = _cells(rng, _DISTRICTS, 2.5)
    _, road = _cells(rng, _TOWNS, 5.0)
    shape = district.shape
    y, x = np.indices(shape, np.float32)
    count = int(district.max()) + 1
    turn, block = rng.uniform(0, np.pi / 2, count), rng.integers(*_BLOCKS, count)
    cosine, sine, step = (a[district].astype(np.float32) for a in (np.cos(turn), np.sin(turn), block))
    streets = np.maximum(_ridge(x * cosine + y * sine, step), _ridge(y * cosine - x * sine, 1.5 * step))
    # built up and dark, from a kilometre to twenty, as a product of many causes has it
    levels = sum(w * _normal(rng, shape, texels) for texels, w in ((1.5, 0.35), (4.0, 0.45), (12.0, 0.4)))
    # a crossing, a square, a mall: points of light that few texels have
    points = rng.lognormal(-0.7, 1.2, shape)
    city = np.exp(levels) * (0.5 + streets * (0.4 + points))
    main_roads = np.exp(-((road / 0.7) ** 2))
    city += 0.5 * np.exp(-((border / 0.6) ** 2)) + 1.5 * np.exp(0.5 * levels) * main_roads
    places = (rng.random(shape) < _VILLAGES) * rng.lognormal(0.0, 1.2, shape)
    village = 0.8 * _soft(places, 0.5) + 0.2 * _soft(places, 1.6) + 0.8 * places.mean() * main_roads
    out = np.empty((*shape, 3), np.uint8)
    for k, light in enumerate((_soft(city, 0.4), village)):
        # cut at the brightest that is held, so that what is held has the mean of one
        for _ in range(8):
            light = np.minimum(light / light.mean(), BRIGHTEST)  # noqa: PLW2901 - step by step
        # rounding to the one or the other side at random keeps the mean of the dark
        out[..., k] = np.minimum(light * (255 / BRIGHTEST) + rng.random(shape), 255)
    white = 0.5 + 0.22 * _normal(rng, shape, 5.0) + 0.22 * _normal(rng, shape, 1.0)
    out[..., 2] = np.clip(white, 0, 1) * 255
    return out


def _ridge(across: Float32Array, step: Float32Array) -> Float32Array:
    """1 on lines that lie a step apart, falling to 0 within a texel or two."""
    away = np.abs(across - step * np.round(across / step))
    return np.asarray(np.exp(-((away / 0.6) ** 2)), np.float32)


def _cells(rng: np.random.Generator, count: int, bend: float) -> tuple[IntArray, Float32Array]:
    """Periodic Voronoi cells of ``count^2`` jittered points: their number, and how far their border is [texels].

    Parameters
    ----------
    bend : of straight borders [texels].
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
    bent = (
        np.rint(k + bend * _normal(rng, (_TILE, _TILE), 3 * bend)).astype(int) % _TILE + pad for k in (y, x)
    )
    cells = np.pad(cells[tuple(bent)], pad, mode="wrap")
    edge = (cells != np.roll(cells, 1, 0)) | (cells != np.roll(cells, 1, 1))
    border = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inner = slice(pad, -pad)
    return cells[inner, inner], np.asarray(border[inner, inner], np.float32)


def _normal(rng: np.random.Generator, shape: tuple[int, int], texels: float) -> Float32Array:
    """Periodic noise of a size, of a standard deviation of one."""
    noise = _soft(rng.standard_normal(shape), texels)
    return np.asarray(noise / noise.std(), np.float32)


def _soft(image: FloatArray, texels: float) -> Float32Array:
    """A periodic blur."""
    pad = int(4 * texels) + 4
    wrapped = np.pad(image.astype(np.float32), pad, mode="wrap")
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), texels)[pad:-pad, pad:-pad], np.float32)
