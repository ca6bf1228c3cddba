"""Photon noise: Poisson deviates in whole electrons, exact for small means, a normal expansion above."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import gammainc, pdtr

from flyaround.simulator.camera.detector.deviates import add_normal, normal_tables, random_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

EXACT_BELOW_E = 12.0
"""Mean up to which the law is drawn exactly; above, its normal expansion differs by less than 1e-3 anywhere."""
_LEVELS_PER_E = 16
_CELL_BITS = 12
_REST_BITS = 32 - _CELL_BITS
_LARGEST_COUNT = 64  # a mean of 12 has more once in 1e26 draws
_UNDECIDED = 255


@lru_cache(maxsize=1)
def _unit_tables() -> tuple[NDArray[Any], ...]:
    return normal_tables(1.0, np.dtype(np.float32), smooth=True)


def poisson(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Electrons of each pixel, drawn with the given mean.

    Parameters
    ----------
    mean_e : (rows, columns) mean number [e], not negative.
    """
    few = mean_e < EXACT_BELOW_E
    if few.all():
        return _counted(mean_e.ravel(), source).reshape(mean_e.shape)
    out = _expanded(mean_e, source)
    where = np.flatnonzero(few)
    if where.size:
        out.ravel()[where] = _counted(mean_e.ravel()[where], source)
    return out


def _expanded(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Third-order normal expansion (skewness 1 / sqrt(mean), excess 1 / mean), in whole electrons.

    References
    ----------
    Fisher & Cornish (1960), The percentile points of distributions having known cumulants, Technometrics 2(2).
    """
    z = np.zeros_like(mean_e)
    add_normal(z, _unit_tables(), source)
    # rounding to whole electrons adds a twelfth to the variance, which is taken off here
    out = mean_e - np.float32(1 / 12)
    np.maximum(out, 1, out=out)
    np.sqrt(out, out=out)
    square = z * z
    square -= 1
    out -= square / (72 * out)
    out *= z
    square *= np.float32(1 / 6)
    out += square
    out += mean_e
    return np.asarray(np.rint(out, out=out))


def _counted(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Exact draws for means below `EXACT_BELOW_E`, (n,).

    A mean is a multiple of 1/16 e and a rest. Counts of the multiple come from the inverse of its distribution
    function: twelve random bits decide all but one draw in two hundred, and more bits decide those. The rest adds
    at most a few, and mostly nothing: one comparison tells.
    """
    counts, cumulated = _inverse_tables()
    words = random_words(source, mean_e.size)
    level = (mean_e * np.float32(_LEVELS_PER_E)).astype(np.int64)
    cell = (words >> np.uint32(_REST_BITS)).astype(np.int64)
    drawn = counts.take((level << _CELL_BITS) + cell, mode="clip")
    out = drawn.astype(np.float32)
    rng = np.random.Generator(source)
    open_ = np.flatnonzero(drawn == _UNDECIDED)
    u = (cell[open_] + rng.random(open_.size)) / 2**_CELL_BITS
    out[open_] = (cumulated[level[open_]] <= u[:, None]).sum(axis=1)
    rest = mean_e - level.astype(np.float32) * np.float32(1 / _LEVELS_PER_E)
    low = words & np.uint32(2**_REST_BITS - 1)
    some = np.flatnonzero(low <= rest * np.float32(2**_REST_BITS))  # the chance of one is less than the mean
    u = (low[some] + rng.random(some.size)) / 2**_REST_BITS
    mean, k = rest[some].astype(float), 0
    while some.size:
        k += 1
        more = u < gammainc(k, mean)  # the chance of at least k
        some, u, mean = some[more], u[more], mean[more]
        out[some] += 1
    return out


@lru_cache(maxsize=1)
def _inverse_tables() -> tuple[ByteArray, FloatArray]:
    """Of every multiple of 1/16 e: the count of each of 4096 equal cells of probability; (levels, 64) P(<= k)."""
    means = np.arange(int(EXACT_BELOW_E * _LEVELS_PER_E) + 1) / _LEVELS_PER_E
    cumulated = np.asarray(pdtr(np.arange(_LARGEST_COUNT)[None, :], means[:, None]), float)
    edges = np.arange(2**_CELL_BITS + 1) / 2**_CELL_BITS
    table = np.empty((means.size, 2**_CELL_BITS), np.uint8)
    for row, chances in zip(table, cumulated, strict=True):
        first = np.searchsorted(chances, edges[:-1], side="right")
        last = np.searchsorted(chances, edges[1:], side="left")
        row[:] = np.where(first == last, first, _UNDECIDED)
    return table.ravel(), cumulated
