"""Consistency of a filter: normalised estimation error squared, and its confidence band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


def chi_square_quantile(probability: float, degrees: float) -> float:
    """Return the quantile of the chi-square distribution."""
    from scipy.special import chdtri  # noqa: PLC0415 - slow to import, and only filters need it

    return float(chdtri(degrees, 1.0 - probability))


def fisher_quantile(probability: float, degrees: float, degrees_of_size: float) -> float:
    """Return the quantile of the F distribution."""
    from scipy.special import fdtri  # noqa: PLC0415 - slow to import, and only filters need it

    return float(fdtri(degrees, degrees_of_size, probability))


def nees(error: FloatArray, covariance: FloatArray) -> float:
    """Return the normalised estimation error squared. Its mean is the number of states if the covariance is correct.

    References
    ----------
    Bar-Shalom, Li & Kirubarajan (2001), Estimation with Applications to Tracking and Navigation, sec. 5.4.
    """
    scale = np.sqrt(np.diag(covariance))
    e = error / scale
    return float(e @ np.linalg.solve(covariance / np.outer(scale, scale), e))


def nees_band(runs: int, states: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the two-sided band of the mean NEES over independent runs at one time.

    Returns
    -------
    tuple of float
        Lower and upper bound; the mean of a consistent filter lies between them with the given probability.
    """
    tail = (1.0 - probability) / 2
    degrees = runs * states
    return chi_square_quantile(tail, degrees) / runs, chi_square_quantile(1.0 - tail, degrees) / runs
