"""Consistency of a filter: normalised estimation errors squared, and the band that they must lie in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


def chi_square_quantile(probability: float, degrees: float) -> float:
    """Value that a chi-square variable stays below with a probability."""
    from scipy.special import chdtri  # noqa: PLC0415 - slow to import: who has no filter need not wait

    return float(chdtri(degrees, 1.0 - probability))


def fisher_quantile(probability: float, degrees: float, degrees_of_size: float) -> float:
    """Value that the ratio of two chi-square variables, each over its degrees of freedom, stays below."""
    from scipy.special import fdtri  # noqa: PLC0415 - slow to import: who has no filter need not wait

    return float(fdtri(degrees, degrees_of_size, probability))


def nees(error: FloatArray, covariance: FloatArray) -> float:
    """Normalised estimation error squared; its mean is the number of states where the covariance is right.

    References
    ----------
    Bar-Shalom, Li & Kirubarajan (2001), Estimation with Applications to Tracking and Navigation, sec. 5.4.
    """
    scale = np.sqrt(np.diag(covariance))
    e = error / scale
    return float(e @ np.linalg.solve(covariance / np.outer(scale, scale), e))


def nees_band(runs: int, states: int, probability: float = 0.95) -> tuple[float, float]:
    """Band of the mean over independent runs of the NEES of one time, two-sided."""
    rest = (1.0 - probability) / 2
    degrees = runs * states
    return chi_square_quantile(rest, degrees) / runs, chi_square_quantile(1.0 - rest, degrees) / runs
