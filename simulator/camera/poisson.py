"""Photon noise: whole electrons by the Poisson law, exact where they can be counted on the fingers."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from simulator.camera.deviates import add_normal, normal_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.arrays import Float32Array

EXACT_BELOW_E = 12.0
"""Mean up to which the law is drawn exactly; above, its normal expansion differs by less than 1e-3 anywhere."""
_RARE_BELOW_E = 1.0


@lru_cache(maxsize=1)
def _unit_tables() -> tuple[NDArray[Any], ...]:
    return normal_tables(1.0, np.dtype(np.float32), smooth=True)


def poisson(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Electrons of each pixel, drawn with the given mean.

    Parameters
    ----------
    mean_e : (rows, columns) mean number [e], not negative.

    References
    ----------
    Fisher & Cornish (1960), The percentile points of distributions having known cumulants, Technometrics 2(2).
    """
    out = np.empty_like(mean_e)
    lowest, highest = float(mean_e.min()), float(mean_e.max())
    if highest >= EXACT_BELOW_E:
        out = _expanded(mean_e, source)
    if lowest < _RARE_BELOW_E:
        rare = slice(None) if highest < _RARE_BELOW_E else np.flatnonzero(mean_e < _RARE_BELOW_E)
        out.ravel()[rare] = _rare(mean_e.ravel()[rare], source)
    if lowest < EXACT_BELOW_E and highest >= _RARE_BELOW_E:
        few = np.flatnonzero((mean_e >= _RARE_BELOW_E) & (mean_e < EXACT_BELOW_E))
        if few.size:
            out.ravel()[few] = np.random.Generator(source).poisson(mean_e.ravel()[few])
    return out


def _expanded(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Third-order normal expansion (skewness 1 / sqrt(mean), excess 1 / mean), in whole electrons."""
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


def _rare(mean_e: Float32Array, source: np.random.SFC64) -> Float32Array:
    """Inverse of the distribution function at an even random number, term by term, from the rare side."""
    words = source.random_raw(-(-mean_e.size // 2)).view(np.uint32)[: mean_e.size]
    v = words.astype(np.float32)
    v += np.float32(0.5)
    v *= np.float32(2.0**-32)
    # 1 - exp(-mean) loses its digits where the mean is small: there the first terms of its series
    some = np.where(mean_e < 0.01, mean_e * (1 - mean_e * (0.5 - mean_e / 6)), 1 - np.exp(-mean_e))
    out = np.zeros_like(mean_e)
    active = np.flatnonzero(v < some)
    mean, rest = mean_e[active].astype(float), v[active].astype(float)
    above = -np.expm1(-mean)  # chance of at least k
    term = np.exp(-mean)
    k = 0
    while active.size:
        k += 1
        out[active] = k
        term *= mean / k
        above -= term
        # 1e-12: a draw in four billion ends the sum before its rounding does
        more = (rest < above) & (above > 1e-12)
        active, mean, rest, above, term = (x[more] for x in (active, mean, rest, above, term))
    return out
