"""Detail noise: one tiling texture for clouds and land below the 5 km texels of the maps, baked once."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

# Side of the texture [texels].
SIZE = 2048
PERIOD_KM = 472.0  # period of the tile: texels of 0.23 km, a pixel of a SPEED camera from 700 km
SLOPE_PER_KM = 0.6  # full scale of the slope channels, plus and minus
GRAIN = 0.7  # full range of the land channel, as a share of the reflectance
_BROAD, _FINE = 512, 1024  # texels of the two fields: one spans the tile, one repeats twice each way

# Weights of the two fields in the cloud detail.
_BROAD_WEIGHT, _FINE_WEIGHT = 0.55, 0.45
_DIFFUSION = 1.5  # texels over which light spreads within a cloud (0.3 km: Davis et al. 1997)
_UNWOODED_SHARE = 0.66  # share of the land without woods

# Frequencies below are in cycles per tile, displacements in texels; weights are relative, because the histogram is made
# flat. Those without a source are chosen by eye.

# Weights of the two fields in the land detail, and in each of patches, fields and dark woods beside creases.
_LAND_WEIGHTS, _GROUND_WEIGHTS = (0.26, 0.42), (0.6, 1.1, 1.6)

# Clouds of `high`; weights and heights chosen by eye.
_GROUP_KM = 7.0  # scale below which groups of clouds are smooth, and puffs take over
_PUFFS = (75, 150, 300, 600)  # puffs along the tile's side: 6 to 0.8 km apart
_PUFF_HEIGHT = 0.38  # power of the spacing to which puffs are high
_CUMULUS_WEIGHTS = (1.2, 1.0, 0.13)  # of groups, puffs and ragged rims
_TOPS = 3.0  # texels over which tops are smoothed before their slopes are taken

# Seed of the pattern; any fixed value serves.
_SEED = 20040800
_STRIP, _ROWS = 1 << 14, 32  # values per look-up and rows per strip, both sized for a processor's cache


def detail_texture() -> ByteArray:
    """Return the tiling texture of detail for clouds and land.

    Returns
    -------
    (SIZE, SIZE, 4) array
        8-bit channels of `make_detail`: cloud detail, its slope along u and v, land detail. From the cache.
    """
    return cached_array(entry_name("detail-noise", (make_detail,)), make_detail)


def make_detail() -> ByteArray:
    """Make two scales in one tile, so that one fetch serves both.

    Channels: cloud detail, 0..1 with a flat histogram; 0.5 + slope / (2 SLOPE_PER_KM) along u and v, of the detail
    blurred as light diffuses in clouds; 0.5 + the land's relative brightness / GRAIN.
    """
    rng = np.random.default_rng(_SEED)
    broad_cloud, broad_land = _field(rng, _BROAD)
    fine_cloud, fine_land = _field(rng, _FINE)
    cloud = _equalise(_BROAD_WEIGHT * _upsample(broad_cloud) + _FINE_WEIGHT * np.tile(fine_cloud, (2, 2)))
    broad, fine = _LAND_WEIGHTS
    land = broad * (_upsample(broad_land) - 0.5) + fine * (np.tile(fine_land, (2, 2)) - 0.5)
    return _packed(cloud, land, _DIFFUSION)


def cumulus_texture() -> ByteArray:
    """Return the tiling texture of detail with cumulus clouds.

    Returns
    -------
    (SIZE, SIZE, 4) array
        8-bit channels as in `detail_texture`, with the clouds of `make_cumulus`. From the cache.
    """
    return cached_array(entry_name("cumulus", (make_cumulus, make_detail)), make_cumulus)


def make_cumulus() -> ByteArray:
    """Make clouds as groups of round puffs, with channels as in `make_detail`; the land is that of `detail_texture`.

    Near a group's rim only its highest puffs pass the threshold, so that it dissolves into separate small clouds. The
    borders' fractal dimension is that of clouds, 1.35 (Lovejoy 1982, Science 216, 185).
    """
    rng, f = np.random.default_rng([_SEED, SIZE]), _frequencies(SIZE)
    # -1.65 in amplitude, steeper below the scale of groups
    groups = f**-1.65 / (1 + (f * _GROUP_KM * SIZE / PERIOD_KM) ** 2) ** 0.6
    layers = [_advect(rng, f, _spectral_noise(rng, f, groups, 5.0), 5.0, 20.0)]
    domes = (_domes(rng, count) * np.float32((_PUFFS[0] / count) ** _PUFF_HEIGHT) for count in _PUFFS)
    layers.append(_blur(_advect(rng, f, reduce(np.maximum, domes), 40.0, 2.0)))
    layers.append(_spectral_noise(rng, f, f**-1.65, 60.0))
    cloud = sum(w / x.std() * (x - x.mean()) for w, x in zip(_CUMULUS_WEIGHTS, layers, strict=True))
    land = (detail_texture()[..., 3] / 255 - 0.5) * GRAIN
    return _packed(_equalise(np.asarray(cloud, np.float32)), np.asarray(land, np.float32), _TOPS)


def _packed(cloud: Float32Array, land: Float32Array, diffusion: float) -> ByteArray:
    """Return the channels of `make_detail`. Slopes are those of the cloud detail blurred by ``diffusion`` texels."""
    tops = _blur(cloud, diffusion)
    out = np.empty((SIZE, SIZE, 4), np.uint8)
    for first in range(0, SIZE, _ROWS):
        rows = slice(first, first + _ROWS)
        around = tops.take(range(first - 1, first + _ROWS + 1), axis=0, mode="wrap")
        out[rows] = _encode(cloud[rows], around, land[rows])
    return out


def _encode(cloud: Float32Array, around: Float32Array, land: Float32Array) -> ByteArray:
    """Encode rows of the tile as `make_detail` describes; (R, SIZE, 4).

    Parameters
    ----------
    cloud : (R, SIZE) array
        Rows of the cloud detail.
    around : (R + 2, SIZE) array
        Blurred cloud tops, with one row above and below.
    land : (R, SIZE) array
        Rows of the land detail.
    """
    texel_km, slope = PERIOD_KM / SIZE, 1 / (2 * SLOPE_PER_KM)
    tops = around[1:-1]
    wide = np.concatenate([tops[:, -1:], tops, tops[:, :1]], axis=1)
    du = (wide[:, 2:] - wide[:, :-2]) / (2 * texel_km)
    dv = (around[2:] - around[:-2]) / (2 * texel_km)
    out = np.empty((*land.shape, 4), np.uint8)
    scaled = ((cloud, 1.0, 0.0), (du, slope, 0.5), (dv, slope, 0.5), (land, 1 / GRAIN, 0.5))
    for k, (channel, scale, middle) in enumerate(scaled):
        out[..., k] = np.clip(channel * (scale * 255) + (middle * 255 + 0.5), 0, 255)
    return out


def _field(rng: np.random.Generator, size: int) -> tuple[Float32Array, Float32Array]:
    """Return cloud and land detail, periodic, each with a flat histogram 0..1."""
    scale = size // 512
    f = _frequencies(size)
    # the -5/3 spectrum of liquid water, smoother below a kilometre (Davis et al. 1996), stretched into filaments
    soft = _spectral_noise(rng, f, _liquid_water(f, scale), 3.0 * scale)
    soft = _advect(rng, f, soft / soft.std(), 3.0 * scale, 14.0)
    soft = _advect(rng, f, soft, 12.0 * scale, 3.0)
    # turrets: domes of three sizes on the crests, each of a radius of 0.87 spacings
    domes = np.zeros((size, size), np.float32)
    for count, weight in ((19, 1.0), (43, 0.8), (97, 0.6)):
        distance = np.float32(1.15) * _worley_noise(rng, size, count * scale)
        domes += weight * np.maximum(1 - distance * distance, 0)
    domes = _advect(rng, f, (domes - domes.mean()) / domes.std(), 12.0 * scale, 3.5)
    cloud = _blur(_equalise(soft + (0.5 + 0.3 * np.clip(soft, -1.5, 2.0)) * domes))
    # valleys: creases of several sizes, as rivers cut them; and patches
    creases = np.zeros((size, size), np.float32)
    steep = f**-1.9
    for k in range(4):
        field = _spectral_noise(rng, f, steep, 4.0 * scale * 2**k)
        creases += 0.65**k * np.sqrt(np.abs(field / field.std()))
    patches = _spectral_noise(rng, f, f**-1.1, 3.0 * scale)
    # fields of distinct brightness, and woods with sharp edges
    field_rng = np.random.default_rng([_SEED, size])
    fields = _voronoi_noise(field_rng, size, 110 * scale) - 0.5
    woods = _equalise(_spectral_noise(field_rng, f, f**-1.6, 8.0 * scale)) > _UNWOODED_SHARE
    of_patches, of_fields, of_woods = _GROUND_WEIGHTS
    mixed = (
        creases / creases.std() + of_patches * patches / patches.std() + of_fields * fields - of_woods * woods
    )
    land = _blur(_equalise(np.asarray(mixed, np.float32)))
    return cloud, land


def _liquid_water(f: FloatArray, scale: int) -> FloatArray:
    """Return amplitudes by frequency: those of stratocumulus liquid water, steeper below the scale break."""
    knee = (90 * scale / len(f)) ** -2
    return np.asarray(f**-1.4 / (1 + f * f * knee) ** 0.7)


def _advect(
    rng: np.random.Generator, frequencies: FloatArray, image: Float32Array, low: float, texels: float
) -> Float32Array:
    """Displace a periodic image by a divergence-free flow of ``texels`` root mean square."""
    size, pad = len(image), 64
    stream = _spectral_noise(rng, frequencies, frequencies**-2.4, low)
    flow = np.roll(stream, -1, 0) - np.roll(stream, 1, 0), np.roll(stream, 1, 1) - np.roll(stream, -1, 1)
    step = np.float32(texels / np.hypot(*flow).std())
    y, x = np.indices((size, size), np.float32)
    to_x, to_y = ((k + step * along) % size + pad for k, along in zip((x, y), flow, strict=True))
    wrapped = np.pad(image.astype(np.float32), pad, mode="wrap")
    return np.asarray(cv2.remap(wrapped, to_x, to_y, interpolation=cv2.INTER_LINEAR), np.float32)


def _upsample(image: Float32Array) -> Float32Array:
    """Enlarge to the size of the tile, periodically."""
    factor, pad = SIZE // len(image), 8
    wrapped = np.pad(image, pad, mode="wrap")
    large = cv2.resize(wrapped, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    return np.asarray(large[pad * factor : -pad * factor, pad * factor : -pad * factor], np.float32)


def _blur(image: Float32Array, texels: float = 0.6) -> Float32Array:
    """Blur periodically, by about a texel."""
    wrapped = np.pad(image, 8, mode="wrap")
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), texels), np.float32)[8:-8, 8:-8]


def _spectral_noise(
    rng: np.random.Generator, frequencies: FloatArray, amplitudes: FloatArray, low: float
) -> Float32Array:
    """Return periodic Gaussian noise with a spectrum's amplitudes, from ``low`` cycles per tile up."""
    size = len(frequencies)
    noise = rng.standard_normal((size, size)).astype(np.float32)
    # lower frequencies belong to the map, and would reveal the tiling
    shape = (amplitudes * (frequencies >= low / size)).astype(np.float32)
    spectrum = np.fft.rfft2(noise) * shape
    return np.asarray(np.fft.irfft2(spectrum, (size, size)), np.float32)


def _frequencies(size: int) -> FloatArray:
    """Return (size, size // 2 + 1) cycles per texel, with 1 in place of 0."""
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    f[0, 0] = 1
    return np.asarray(f)


def _worley_noise(rng: np.random.Generator, size: int, count: int) -> Float32Array:
    """Return periodic Worley noise (1996): distance to the nearest of ``count^2`` jittered points over the spacing."""
    spacing, pad = size / count, 32
    cell = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1)
    x, y = np.moveaxis(((cell + rng.random((count, count, 2))) * spacing).astype(int), -1, 0)
    away = np.ones((size, size), np.uint8)
    away[y, x] = 0
    wrapped = np.pad(away, pad, mode="wrap")
    distance = cv2.distanceTransform(wrapped, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distance[pad:-pad, pad:-pad] / np.float32(spacing), np.float32)


def _domes(rng: np.random.Generator, count: int) -> Float32Array:
    """Return paraboloids of random height, periodic, one in each Voronoi cell of ``count^2`` jittered points."""
    # at half a spacing a dome has dropped by 0.4 of the largest height
    distance, height = _voronoi_cells(rng, SIZE, count)
    return np.asarray(height - 1.6 * (distance * np.float32(count / SIZE)) ** 2, np.float32)


def _voronoi_noise(rng: np.random.Generator, size: int, count: int) -> Float32Array:
    """Return periodic Voronoi noise: a number 0..1 for each cell of ``count^2`` jittered points."""
    return _voronoi_cells(rng, size, count)[1]


def _voronoi_cells(rng: np.random.Generator, size: int, count: int) -> tuple[Float32Array, Float32Array]:
    """Return the distance to the nearest of ``count^2`` jittered points [texels], and a number 0..1 for each point."""
    spacing = size / count
    pad = max(32, int(3 * spacing))
    cell = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1)
    x, y = np.moveaxis(((cell + rng.random((count, count, 2))) * spacing).astype(int), -1, 0)
    away = np.ones((size, size), np.uint8)
    away[y, x] = 0
    value = rng.random((size, size)).astype(np.float32)
    wrapped = np.pad(away, pad, mode="wrap")
    distance, nearest = cv2.distanceTransformWithLabels(
        wrapped, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.append(0, np.pad(value, pad, mode="wrap")[wrapped == 0]).astype(np.float32)
    return np.asarray(distance, np.float32)[pad:-pad, pad:-pad], of_label[nearest][pad:-pad, pad:-pad]


def _equalise(image: Float32Array) -> Float32Array:
    """Equalise the histogram: each value becomes the share of values below it."""
    counts, edges = np.histogram(image, bins=4096)
    below = np.append(0, np.cumsum(counts)) / image.size
    # an evenly spaced table is faster than a binary search for every value
    rise, out = np.diff(below), np.empty(image.shape, np.float32)
    rows_each = max(_STRIP // image.shape[1], 1)  # strips that fit a processor's cache
    for first in range(0, len(image), rows_each):
        rows, into = (whole[first : first + rows_each] for whole in (image, out))
        place = (rows - float(edges[0])) * float(4096 / (edges[-1] - edges[0]))
        k = np.minimum(place.astype(np.int32), 4095)
        np.add(below[k], (place - k) * rise[k], out=into)
    return out
