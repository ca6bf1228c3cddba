"""Mean pixel value as a function of brightness, for noise clipped at both ends of the scale."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import erf, exp, pi, sqrt
from typing import Tuple

import numpy as np

Array = np.ndarray

# Half-width of the tables [standard deviations of the noise]; beyond it, clipping changes the mean by under 1e-5 sigma.
TABLE_SIGMAS = 4

# Table steps per standard deviation.
STEPS_PER_SIGMA = 64


@dataclass(frozen=True)
class Response:
    """Mean pixel value at a brightness x.

    It is the mean of ``clip(x + n, 0, full)`` for normal noise n. If the noise is not clipped at zero (``sigma`` is 0),
    it is ``min(x, full)``, without a lower bound: the native library computes the same. Clipping at zero raises the
    mean of dark pixels only, which shifts an edge in front of empty space inwards.

    Parameters
    ----------
    sigma : float
        Standard deviation of n before clipping; 0 if the noise is not clipped at zero.
    full_scale : float
        Full scale, the largest pixel value.
    """

    sigma: float
    full_scale: float

    def mean(self, x: Array) -> Array:
        """Return the mean pixel value at each brightness, float32 for a float32 array."""
        if self.sigma <= 0:
            return np.minimum(x, np.float32(self.full_scale))
        lift, _ = tables()
        step = np.float32(STEPS_PER_SIGMA / self.sigma)
        low = np.rint(x * step + np.float32(TABLE_SIGMAS * STEPS_PER_SIGMA)).astype(np.intp)
        high = low - round(self.full_scale * STEPS_PER_SIGMA / self.sigma)
        mean = lift.take(low, mode="clip")
        # most images do not reach full scale, and the table starts with zero
        if int(high.max(initial=0)) > 0:
            mean -= lift.take(high, mode="clip")
        mean *= np.float32(self.sigma)
        mean += np.clip(x, 0.0, np.float32(self.full_scale))
        return mean


def _mean(u: float) -> float:
    """Return the mean of max(u + n, 0) for normal noise n of unit variance."""
    return 0.5 * u * (1.0 + erf(u / sqrt(2.0))) + exp(-0.5 * u * u) / sqrt(2.0 * pi)


@lru_cache(maxsize=1)
def means() -> Tuple[Array, Array]:
    """Return u = -1 .. TABLE_SIGMAS and the mean of max(u + n, 0) for normal noise n of unit variance."""
    u = np.linspace(-1.0, TABLE_SIGMAS, TABLE_SIGMAS * STEPS_PER_SIGMA)
    return u, np.array([_mean(float(v)) for v in u])


@lru_cache(maxsize=1)
def tables() -> Tuple[Array, Array]:
    """Return the mean of max(u + n, 0) minus max(u, 0), and its derivative, for |u| up to ``TABLE_SIGMAS``."""
    u = np.linspace(-TABLE_SIGMAS, TABLE_SIGMAS, 2 * TABLE_SIGMAS * STEPS_PER_SIGMA + 1)
    lift = np.array([_mean(float(v)) - max(float(v), 0.0) for v in u], np.float32)
    share = np.array([0.5 * (1.0 + erf(float(v) / sqrt(2.0))) for v in u], np.float32)
    lift[[0, -1]], share[[0, -1]] = 0.0, (0.0, 1.0)
    return lift, share
