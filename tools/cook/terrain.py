"""Make the terrain detail below the texels of the maps in `high`: one periodic tile of ridges and dry valleys.

In land that rivers have eroded for long, height rises along each river by area^-0.45 (Flint's law), and water from
every point drains along its path of least cost, where the costs follow from the drainage areas. Shortest paths and
costs are therefore computed in turn until both agree (optimal channel networks: Rinaldo et al. 1992).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from flyaround.simulator.celestial.earth_maps import TERRAIN_SLOPE_MAX

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray, IntArray

SIZE = 1024  # side of the tile [texels]
_COARSE = 512  # side of the coarse grid
_TURNS = 3  # iterations until costs and areas agree, on the coarse grid
_CONCAVITY = 0.45  # Flint's exponent: decrease of slope with upstream area (Whipple & Tucker 1999)
_SLOPE = 0.24  # root mean square slope of desert mountains over 400 m
_PLAINS = 0.05  # share of the tile that is plain, into which the rest drains
_SEED = 20260320  # any seed; this one was shipped


def make_terrain_detail() -> ByteArray:
    """Return the tile, (SIZE, SIZE, 4).

    Channels: ``0.5 + slope / (2 TERRAIN_SLOPE_MAX)`` along u and v; 0.5 + brightness of the rock, of mean 0 and
    standard deviation 0.2; share of gravel and sand, brighter than rock, on valley floors.
    """
    rng = np.random.default_rng(_SEED)
    base = _spectral_noise(rng, _COARSE, 2.0, -1.7)
    plains = base < np.quantile(base, _PLAINS)
    hardness = np.exp(
        0.55 * _spectral_noise(rng, _COARSE, 4.0, -1.0) + 0.35 * rng.standard_normal(base.shape)
    )
    _, area = drainage(plains, hardness, _TURNS)
    # the same land on the fine grid, starting from the channels of the coarse grid
    fine = _upsampled(hardness) * np.exp(0.4 * rng.standard_normal((SIZE, SIZE)))
    fine_area = np.exp(_upsampled(np.log(area)))
    height, area = drainage(_upsampled(plains.astype(float)) > 0.5, fine, 0, fine_area)
    height = _blurred(height, 1.1)
    slopes = [0.5 * (np.roll(height, -1, axis) - np.roll(height, 1, axis)) for axis in (1, 0)]
    steep = _SLOPE / np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2))
    # the band of gravel and sand widens with the stream
    floor = sum(_blurred(np.clip(np.log(area) - k, 0.0, 1.0), 0.6 * 1.5**k) for k in (3, 4, 5, 6))
    floor = np.clip(floor + _blurred(_upsampled(plains.astype(float)), 1.5), 0.0, 1.0)
    # ridges are bare and dark, deposits are pale; rock units differ in brightness
    crest = _blurred(height, 10.0) - _blurred(height, 1.5)
    units = _steps(rng, 1.6 * _spectral_noise(rng, SIZE, 2.0, -1.8))
    rock = crest / crest.std() + 0.45 * units / units.std() + 0.3 * _spectral_noise(rng, SIZE, 20.0, -0.9)
    rock = 0.2 * (rock - rock.mean()) / rock.std()
    channels = [0.5 + s * (steep / (2 * TERRAIN_SLOPE_MAX)) for s in slopes] + [0.5 + rock, floor]
    return np.dstack([np.clip(255 * c + 0.5, 0, 255).astype(np.uint8) for c in channels])


def drainage(
    outlets: BoolArray, hardness: FloatArray, turns: int, area: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the optimal channel network of a periodic land: height, in units of cost, and drainage area [texels].

    Parameters
    ----------
    outlets : BoolArray
        (N, N) array, True at outlets, whose height is 0.
    hardness : (N, N) array
        Cost of a step at a point that drains only itself.
    turns : int
        Iterations after the first.
    area : (N, N) array, optional
        Initial drainage area [texels].
    """
    for _ in range(turns + 1):
        height, down = _least_cost_paths(hardness if area is None else hardness * area**-_CONCAVITY, outlets)
        area = _drainage_areas(down).reshape(height.shape)
    return height, np.asarray(area)


def _least_cost_paths(cost: FloatArray, outlets: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the (N, N) least cost of a path to an outlet, and (N * N,) the next point on it; an outlet's is itself."""
    size = len(cost)
    index = np.arange(size * size).reshape(size, size)
    steps = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = np.roll(cost, (-down, -right), (0, 1))
        steps.append((np.roll(index, (-down, -right), (0, 1)), np.hypot(down, right) / 2 * (cost + other)))
    ends, weights = (np.concatenate([step[k].ravel() for step in steps]) for k in (0, 1))
    graph = csr_matrix((weights, (np.tile(index.ravel(), len(steps)), ends)), shape=(size * size,) * 2)
    least, before, _ = dijkstra(
        graph, directed=False, indices=np.flatnonzero(outlets), min_only=True, return_predecessors=True
    )
    return least.reshape(cost.shape), np.where(before < 0, index.ravel(), before)


def _drainage_areas(down: IntArray) -> FloatArray:
    """Return the drainage area of each point, itself included [texels], from the next point downstream of each."""
    far, hops = down, (down != np.arange(len(down))).astype(int)
    # path doubling: each iteration doubles the hops
    while hops[far].any():
        hops = hops + hops[far]
        far = far[far]
    order = np.argsort(-hops, kind="stable")
    area = np.ones(len(down))
    for points in np.split(order, np.flatnonzero(np.diff(hops[order])) + 1):
        if hops[points[0]]:
            np.add.at(area, down[points], area[points])
    return area


def _steps(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Return a random number for each unit interval of x, with a transition over a tenth of a unit."""
    values = rng.standard_normal(64)
    floor = np.floor(x)
    share = np.clip(10 * (x - floor), 0.0, 1.0)
    k = floor.astype(int)
    return np.asarray(values[(k - 1) % 64] * (1 - share) + values[k % 64] * share)


def _spectral_noise(rng: np.random.Generator, size: int, low: float, power: float) -> FloatArray:
    """Return periodic unit-variance Gaussian noise with a power-law spectrum above ``low`` cycles per tile."""
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    f[0, 0] = 1
    noise = np.fft.irfft2(
        np.fft.rfft2(rng.standard_normal((size, size))) * f**power * (f >= low / size), (size, size)
    )
    return np.asarray(noise / noise.std())


def _upsampled(image: FloatArray) -> FloatArray:
    """Return a coarse periodic grid interpolated to the fine one."""
    pad, factor = 4, SIZE // _COARSE
    large = cv2.resize(np.pad(image, pad, mode="wrap"), None, fx=factor, fy=factor)
    return np.asarray(large[pad * factor : -pad * factor, pad * factor : -pad * factor])


def _blurred(image: FloatArray, sigma: float) -> FloatArray:
    """Return an image blurred with periodic boundaries."""
    return np.asarray(cv2.GaussianBlur(np.pad(image, 24, mode="wrap"), (0, 0), sigma)[24:-24, 24:-24])
