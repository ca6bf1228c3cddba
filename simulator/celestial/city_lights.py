"""City lights below the night map's texels: one tiling texture of streets and lit blocks, mean one, baked once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array

SIZE = 1024
PERIOD_KM = 118.0  # of the tile, a quarter of the detail's: texels of 0.12 km
BRIGHTEST = 12.0  # times the mean: what the light's channel holds
MAP_MAX_W_M2_SR = 7.0e-4
"""Radiance of a texel of the night map at its brightest, 70 nW cm-2 sr-1 over its 5 km, in the band of VIIRS.

The map is a picture of Suomi NPP's day-night band of 2012. With this figure 50 km around the largest cities send 25 to
60 nW cm-2 sr-1, as Elvidge et al. (2017, Int. J. Remote Sensing 38, 5860) map them.
"""
_SEED = 20120401
_DISTRICTS, _TOWNS = 26, 9  # cells along a side: of one direction of streets, and between main roads
_VILLAGES = 1 / 300  # of the texels: one in 4 km2
_BLOCKS = (5, 9)  # texels between streets: 0.6 to 1 km; smaller streets in between are the glow


def city_texture() -> ByteArray:
    """(SIZE, SIZE, 4) of light of cities and of villages over its mean, share of white lamps, 255; from the cache."""
    return cached_array(entry_name("city-lights", (make_city_lights,)), make_city_lights)


def make_city_lights() -> ByteArray:
    """Grids of streets turned from district to district, main roads, dark parks, crossings; and villages on roads."""
    rng = np.random.default_rng(_SEED)
    district, border = _cells(rng, _DISTRICTS)
    _, road = _cells(rng, _TOWNS)
    y, x = np.indices((SIZE, SIZE), np.float32)
    count = int(district.max()) + 1
    turn, block = rng.uniform(0, np.pi / 2, count), rng.integers(*_BLOCKS, count)
    level, white = rng.lognormal(-0.2, 0.6, count), rng.beta(0.7, 0.7, count)
    cosine, sine, step = (a[district].astype(np.float32) for a in (np.cos(turn), np.sin(turn), block))
    streets = np.maximum(_ridge(x * cosine + y * sine, step), _ridge(y * cosine - x * sine, 1.5 * step))
    # a crossing, a square, a mall: points of light that few texels have
    points = rng.lognormal(-0.7, 1.2, (SIZE, SIZE))
    glow = _soft(rng.lognormal(0.0, 1.0, (SIZE, SIZE)), 2.0)
    city = _soft(level[district], 3.0) * (0.25 * glow + streets * (0.6 + points))
    main_roads = np.exp(-((road / 1.1) ** 2))
    city += 1.2 * np.exp(-((border / 0.9) ** 2)) + 2.5 * main_roads
    places = (rng.random((SIZE, SIZE)) < _VILLAGES) * rng.lognormal(0.0, 1.2, (SIZE, SIZE))
    village = 0.7 * _soft(places, 0.8) + 0.3 * _soft(places, 2.5) + 1.5 * places.mean() * main_roads
    out = np.full((SIZE, SIZE, 4), 255, np.uint8)
    for k, light in enumerate((_soft(city, 0.7), village)):
        # cut at the brightest that is held, so that what is held has the mean of one
        for _ in range(8):
            light = np.minimum(light / light.mean(), BRIGHTEST)  # noqa: PLW2901 - step by step
        # rounding to the one or the other side at random keeps the mean of the dark
        out[..., k] = np.minimum(light * (255 / BRIGHTEST) + rng.random(light.shape), 255)
    out[..., 2] = _soft(white[district], 1.5) * 255
    return out


def _ridge(across: Float32Array, step: Float32Array) -> Float32Array:
    """1 on lines that lie a step apart, falling to 0 within a texel or two."""
    away = np.abs(across - step * np.round(across / step))
    return np.asarray(np.exp(-((away / 0.8) ** 2)), np.float32)


def _cells(rng: np.random.Generator, count: int) -> tuple[Float32Array, Float32Array]:
    """Periodic Voronoi cells of ``count^2`` jittered points: their number, and how far their border is [texels]."""
    pad, spacing = SIZE // 4, SIZE / count
    cell = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1)
    x, y = np.moveaxis(((cell + rng.random((count, count, 2))) * spacing).astype(int), -1, 0)
    number = np.zeros((SIZE, SIZE), np.int64)
    number[y, x] = np.arange(count * count).reshape(count, count)
    seed = np.zeros((SIZE, SIZE), bool)
    seed[y, x] = True
    wrapped = np.pad(seed, pad, mode="wrap")
    _, nearest = cv2.distanceTransformWithLabels(
        (~wrapped).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.append(0, np.pad(number, pad, mode="wrap")[wrapped])
    cells = of_label[nearest]
    edge = (cells != np.roll(cells, 1, 0)) | (cells != np.roll(cells, 1, 1))
    border = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inner = slice(pad, -pad)
    return cells[inner, inner], np.asarray(border[inner, inner], np.float32)


def _soft(image: Float32Array, texels: float) -> Float32Array:
    """A periodic blur."""
    wrapped = np.pad(image.astype(np.float32), 16, mode="wrap")
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), texels)[16:-16, 16:-16], np.float32)
