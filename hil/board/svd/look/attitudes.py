"""Functions on the rotations: sums of bumps about evenly spread attitudes.

The network gives one coefficient per anchor; ``sum_j a_j (q . q_j)^n`` with even n is a smooth function on SO(3), the
logarithm of how likely an attitude is. Several separate maxima are the rule: a craft has near-symmetries.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

Array = np.ndarray

# Anchors, and the power that makes a bump some 30 degrees wide.
ANCHORS, POWER = 768, 20

# Second irrational step of the spiral: a root of x^4 = x + 4.
PSI = 1.533751168755204288118041


@lru_cache(maxsize=8)
def even_attitudes(n: int) -> Array:
    """(n, 4) nearly even attitudes.

    References
    ----------
    Alexa (2022), Super-Fibonacci spirals: fast, low-discrepancy sampling of SO(3), CVPR.
    """
    s = np.arange(n) + 0.5
    r, R = np.sqrt(s / n), np.sqrt(1 - s / n)
    a, b = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / PSI
    return np.stack([r * np.sin(a), r * np.cos(a), R * np.sin(b), R * np.cos(b)], axis=-1)


def bumps(q: Array) -> Array:
    """(N, ANCHORS) value of each anchor's bump at attitudes (N, 4)."""
    return np.asarray((q @ even_attitudes(ANCHORS).T) ** POWER)
