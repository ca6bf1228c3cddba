"""Tiling noise for the detail below the maps' 5 km texels: baked once, because arithmetic noise is what costs most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import ByteArray, FloatArray

SIZE = 512
GRADIENT_SCALE = 3.0  # the gradient channels hold +-1 / this per texel
_SEED = 20040800


def detail_texture() -> ByteArray:
    """(SIZE, SIZE, 4): cloud detail (even histogram), its gradient along u and v, land detail (mean 0.5)."""
    rng = np.random.default_rng(_SEED)
    # turrets: puffs of three sizes, brightest at their middles, on a turbulent field
    puffs = np.zeros((SIZE, SIZE))
    for count, weight in ((22, 1.0), (53, 0.7), (120, 0.45)):
        puffs += weight * (1 - _cellular(rng, count))
    soft = _fractal(rng, 1.25)
    cloud = _equalise(soft / soft.std() + 0.75 * (puffs - puffs.mean()) / puffs.std())
    cloud = _soften(cloud)
    du = (np.roll(cloud, -1, axis=1) - np.roll(cloud, 1, axis=1)) / 2
    dv = (np.roll(cloud, -1, axis=0) - np.roll(cloud, 1, axis=0)) / 2
    # valleys: creases of several sizes, as rivers cut them, and patches
    creases = np.zeros((SIZE, SIZE))
    for k in range(4):
        field = _fractal(rng, 1.9, low=4.0 * 2**k)
        creases += 0.65**k * np.sqrt(np.abs(field / field.std()))
    patches = _fractal(rng, 1.1)
    land = _equalise(creases / creases.std() + 0.6 * patches / patches.std())
    land = _soften(land)
    channels = np.dstack([cloud, 0.5 + du * GRADIENT_SCALE / 2, 0.5 + dv * GRADIENT_SCALE / 2, land])
    return np.ascontiguousarray(np.clip(channels * 255 + 0.5, 0, 255).astype(np.uint8))


def _soften(image: FloatArray) -> FloatArray:
    """A blur of about a texel that keeps the tile's edges matching."""
    wrapped = np.pad(image, 8, mode="wrap")
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), 0.6), float)[8:-8, 8:-8]


def _fractal(rng: np.random.Generator, power: float, low: float = 3.0) -> FloatArray:
    """Gaussian noise of amplitude spectrum ``frequency^-power`` from ``low`` cycles per tile up, periodic."""
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.fftfreq(SIZE)[None, :])
    f[0, 0] = 1
    # the lowest frequencies are the map's business, and would show the tile
    spectrum = np.fft.fft2(rng.standard_normal((SIZE, SIZE))) * f**-power * (f >= low / SIZE)
    return np.asarray(np.fft.ifft2(spectrum).real)


def _cellular(rng: np.random.Generator, count: int) -> FloatArray:
    """Distance to the nearest of ``count^2`` jittered points over their spacing, periodic (Worley 1996)."""
    spacing = SIZE / count
    jitter = rng.random((count, count, 2))
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    cy, cx = (y / spacing).astype(int), (x / spacing).astype(int)
    best = np.full((SIZE, SIZE), np.inf)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            point = jitter[(cy + dy) % count, (cx + dx) % count]
            px, py = (cx + dx + point[..., 0]) * spacing, (cy + dy + point[..., 1]) * spacing
            best = np.minimum(best, np.hypot(px - x, py - y) / spacing)
    return best


def _equalise(image: FloatArray) -> FloatArray:
    """Rank of each value, 0..1: a threshold at 1 - c then leaves exactly the share c."""
    order = np.empty(image.size)
    order[np.argsort(image, axis=None)] = np.arange(image.size)
    return ((order + 0.5) / image.size).reshape(image.shape)
