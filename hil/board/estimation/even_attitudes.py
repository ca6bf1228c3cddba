"""Low-discrepancy sampling of SO(3)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

Array = np.ndarray


@lru_cache(maxsize=4)
def even_attitudes(n: int) -> Array:
    """Return (n, 4) nearly uniformly distributed attitude quaternions.

    References
    ----------
    Alexa (2022), Super-Fibonacci spirals: fast, low-discrepancy sampling of SO(3), CVPR.
    """
    # the positive root of x^4 = x + 4
    psi = 1.533751168755204288118041
    s = np.arange(n) + 0.5
    r, R = np.sqrt(s / n), np.sqrt(1 - s / n)
    a, b = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / psi
    return np.stack([r * np.sin(a), r * np.cos(a), R * np.sin(b), R * np.cos(b)], axis=-1)
