"""Random deviates fast enough for video: normal and uniform numbers from random bytes, and Poisson counts.

A normal deviate is made from two random bytes. Each byte selects the mean of one of 256 equiprobable slices of the
normal distribution. The two means are added with unequal weights, which gives 65536 values. A small cubic term corrects
the fourth moment. Mean, variance and kurtosis are exact, the distribution function has an error of at most 6e-4, and
the largest deviate is 4.2 sigma.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from scipy.optimize import brentq
from scipy.special import gammainc, ndtri, pdtr

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

NOISE_BANDS = 8
"""Number of bands of rows, each with its own random numbers, into which an image is divided for threads."""
# weights of the means that random bytes select; their squares add up to 1, so that the variance is kept
_WEIGHTS = (0.75, float(np.sqrt(1 - 0.75**2)))
_FINE_WEIGHTS = (0.61, 0.58, float(np.sqrt(1 - 0.61**2 - 0.58**2)))
EXACT_POISSON_MAX_E = 12.0
"""Mean up to which the Poisson distribution is sampled exactly [e]. Above it, the error of its normal expansion is less
than 1e-3."""
_LEVELS_PER_E = 16  # tabulated means per electron
_CELL_BITS = (
    12  # bits of a random word that select a cell of the table; the other bits decide within the cell
)
_REMAINING_BITS = 32 - _CELL_BITS
_MAX_COUNT = 64  # a mean of 12 exceeds it once in 1e26 draws
_UNDECIDED = 255  # code of a count that its first random bits leave open


def for_each_band(rows: int, work: Callable[[int, slice], None]) -> None:
    """Call ``work(k, rows)`` for each fixed band of rows, on two threads.

    The bands depend on the image's height alone, so the result does not depend on the number of threads.
    """
    edges = np.linspace(0, rows, NOISE_BANDS + 1).astype(int).tolist()
    list(sensor_threads().map(lambda k: work(k, slice(edges[k], edges[k + 1])), range(NOISE_BANDS)))


def sensor_threads() -> ThreadPoolExecutor:
    """Return this process's threads for the parts of an image; a task there must not wait for another."""
    return _threads(os.getpid())


@lru_cache(maxsize=1)
def _threads(_process: int) -> ThreadPoolExecutor:
    """Return a pool of two threads of this process. Starting threads would take as long as computing a band."""
    return ThreadPoolExecutor(2, thread_name_prefix="flyaround-sensor")


def bit_source(seed: int, *key: int) -> np.random.SFC64:
    """Return a bit generator that depends only on seed and key.

    Returns
    -------
    numpy.random.SFC64
        New generator, at the start of its sequence; one with another key is independent of it.
    """
    return np.random.SFC64(np.random.SeedSequence(seed, spawn_key=key))


def random_bytes(source: np.random.SFC64, shape: tuple[int, ...]) -> ByteArray:
    """Return uniform random bytes."""
    count = int(np.prod(shape))
    return _raw(source, -(-count // 8)).view(np.uint8)[:count].reshape(shape)


def random_words(source: np.random.SFC64, count: int) -> NDArray[np.uint32]:
    """Return (count,) uniform random words of 32 bits."""
    return _raw(source, -(-count // 2)).view(np.uint32)[:count]


def _raw(source: np.random.SFC64, count: int) -> NDArray[np.uint64]:
    # random_raw gives the same numbers, but it holds the GIL, so the second thread would wait
    return np.random.Generator(source).integers(0, 2**64 - 1, count, np.uint64, endpoint=True)


@lru_cache(maxsize=1)
def _slices() -> FloatArray:
    """Return the 256 values that a byte selects; their variance is 1, and their weighted sum has kurtosis 3."""
    edges = ndtri(np.arange(257) / 256)
    density = np.exp(-(edges**2) / 2) / np.sqrt(2 * np.pi)
    means = (density[:-1] - density[1:]) * 256

    def corrected(cubic: float) -> FloatArray:
        table = means + cubic * means**3
        return np.asarray(table / np.sqrt(np.mean(table**2)))

    def excess_kurtosis(cubic: float) -> float:
        # the excess kurtosis of a term has the sign of that of the sum
        return float(np.mean(corrected(cubic) ** 4)) - 3

    return corrected(float(brentq(excess_kurtosis, -0.01, 0.05)))


def normal_tables(sigma: float, dtype: np.dtype[Any], *, smooth: bool = False) -> tuple[NDArray[Any], ...]:
    """Return tables for `add_normal` that give deviates of standard deviation ``sigma``, float32 or int16.

    Parameters
    ----------
    sigma : float
        Standard deviation of the deviates.
    dtype : dtype
        Type of the tables: float32 or int16.
    smooth : bool, optional
        True for three bytes per deviate (16.7 million values), if a histogram would show 65536.
    """
    tables = [_slices() * (w * sigma) for w in (_FINE_WEIGHTS if smooth else _WEIGHTS)]
    if dtype.kind == "i":
        tables = [np.rint(table) for table in tables]
    return tuple(table.astype(dtype)[None] for table in tables)


def add_normal(values: NDArray[Any], tables: tuple[NDArray[Any], ...], source: np.random.SFC64) -> None:
    """Add a normal deviate to each value of a (rows, columns) array of the tables' type, in place."""
    selectors = random_bytes(source, (len(tables), *values.shape))
    scratch = np.empty_like(values)
    for selector, table in zip(selectors, tables, strict=True):
        cv2.LUT(selector, table, dst=scratch)
        values += scratch


def uniform_factors(shape: tuple[int, ...], half_width: float, source: np.random.SFC64) -> Float32Array:
    """Return factors 1 + n, with n uniform between -``half_width`` and ``half_width``."""
    words = random_bytes(source, (*shape[:-1], shape[-1] * 2)).view(np.uint16)
    factor = words.astype(np.float32)
    step = np.float32(2 * half_width / 65536)
    factor *= step
    factor += np.float32(1 - half_width) + step / 2
    return factor


@lru_cache(maxsize=1)
def _unit_tables() -> tuple[NDArray[Any], ...]:
    return normal_tables(1.0, np.dtype(np.float32), smooth=True)


def poisson(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Draw the electrons of each pixel with the given mean.

    Parameters
    ----------
    mean_e : (rows, columns) array
        Mean number [e], not negative.
    source : SFC64
        Bit generator to draw from.

    Returns
    -------
    array
        Electrons of the input's shape, float32.
    """
    is_small = mean_e < EXACT_POISSON_MAX_E
    if is_small.all():
        return _sample_exact(mean_e.ravel(), source).reshape(mean_e.shape)
    electrons = _sample_expansion(mean_e, source)
    indices = np.flatnonzero(is_small)
    if indices.size:
        electrons.ravel()[indices] = _sample_exact(mean_e.ravel()[indices], source)
    return electrons


def _sample_expansion(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Draw from the third-order normal expansion (skewness 1 / sqrt(mean), excess 1 / mean), in whole electrons.

    References
    ----------
    Fisher & Cornish (1960), The percentile points of distributions having known cumulants, Technometrics 2(2).
    """
    z = np.zeros_like(mean_e)
    add_normal(z, _unit_tables(), source)
    # rounding to whole electrons adds 1/12 to the variance, which is subtracted here
    electrons = mean_e - np.float32(1 / 12)
    np.maximum(electrons, 1, out=electrons)
    np.sqrt(electrons, out=electrons)
    square = z * z
    square -= 1
    electrons -= square / (72 * electrons)
    electrons *= z
    square *= np.float32(1 / 6)
    electrons += square
    electrons += mean_e
    return np.asarray(np.rint(electrons, out=electrons))


def _sample_exact(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Draw exactly for means below `EXACT_POISSON_MAX_E`, (n,).

    The mean is split into a multiple of 1/16 e and a remainder. The count of the multiple is drawn from a table of its
    inverse distribution function. Twelve random bits determine all but one draw in two hundred; these use more bits.
    The remainder rarely adds a count, which one comparison detects.
    """
    counts, cumulated = _inverse_tables()
    words = random_words(source, mean_e.size)
    level = (mean_e * np.float32(_LEVELS_PER_E)).astype(np.int64)
    cell = (words >> np.uint32(_REMAINING_BITS)).astype(np.int64)
    counts_drawn = counts.take((level << _CELL_BITS) + cell, mode="clip")
    electrons = counts_drawn.astype(np.float32)
    rng = np.random.Generator(source)
    undecided = np.flatnonzero(counts_drawn == _UNDECIDED)
    u = (cell[undecided] + rng.random(undecided.size)) / 2**_CELL_BITS
    electrons[undecided] = (cumulated[level[undecided]] <= u[:, None]).sum(axis=1)
    remainder = mean_e - level.astype(np.float32) * np.float32(1 / _LEVELS_PER_E)
    remaining_bits = words & np.uint32(2**_REMAINING_BITS - 1)
    # probability of one count, or more
    candidates = np.flatnonzero(remaining_bits <= remainder * np.float32(2**_REMAINING_BITS))
    u = (remaining_bits[candidates] + rng.random(candidates.size)) / 2**_REMAINING_BITS
    mean, k = remainder[candidates].astype(float), 0
    while candidates.size:
        k += 1
        exceeds = u < gammainc(k, mean)  # probability of at least k
        candidates, u, mean = candidates[exceeds], u[exceeds], mean[exceeds]
        electrons[candidates] += 1
    return electrons


@lru_cache(maxsize=1)
def _inverse_tables() -> tuple[ByteArray, FloatArray]:
    """Return tables for multiples of 1/16 e: counts of 4096 equal probability cells, and (levels, 64) P(<= k)."""
    means = np.arange(int(EXACT_POISSON_MAX_E * _LEVELS_PER_E) + 1) / _LEVELS_PER_E
    cumulated = np.asarray(pdtr(np.arange(_MAX_COUNT)[None, :], means[:, None]), float)
    edges = np.arange(2**_CELL_BITS + 1) / 2**_CELL_BITS
    table = np.empty((means.size, 2**_CELL_BITS), np.uint8)
    for row, probabilities in zip(table, cumulated, strict=True):
        first = np.searchsorted(probabilities, edges[:-1], side="right")
        last = np.searchsorted(probabilities, edges[1:], side="left")
        row[:] = np.where(first == last, first, _UNDECIDED)
    return table.ravel(), cumulated
