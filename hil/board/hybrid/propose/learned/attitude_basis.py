"""Functions on the rotations: sums of bumps about evenly spread attitudes.

The network gives one coefficient per anchor; ``sum_j a_j (q . q_j)^n`` with even n is a smooth function on SO(3), the
logarithm of how likely an attitude is. Several separate maxima are the rule: a craft has near-symmetries.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

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


def harmonics() -> Array:
    """(POWER / 2 + 1,) of a bump as a function of the turn about a direction: cos(x / 2)^POWER = sum_m h_m cos(m x)."""
    half = POWER // 2
    h = np.array([comb(POWER, half - m) for m in range(half + 1)]) / 2.0**POWER
    return np.where(np.arange(half + 1) > 0, 2 * h, h)


def turning_bumps(q: Array) -> Array:
    """(3, N, ANCHORS) float32 size, cosine and sine of each anchor's bump as attitudes (N, 4) are turned.

    Turned by x about the line of sight an attitude sees the bump size * cos((x - angle) / 2)^POWER.
    """
    quarter = np.array([0.0, 0.0, 0.0, 1.0])
    a, b = (v @ even_attitudes(ANCHORS).T for v in (q, quat.multiply(quarter, q)))
    square = np.maximum(a * a + b * b, 1e-12)
    return np.stack([square ** (POWER // 2), (a * a - b * b) / square, 2 * a * b / square]).astype(np.float32)


def quartered(coefficients: Array) -> Array:
    """(..., 4, ANCHORS) what inputs turned by none to three quarters say, for each power of a quarter turn.

    Their mean, even ones less odd ones, and the first less the third and the second less the fourth, of which a power
    with an odd exponent is made.
    """
    c0, c1, c2, c3 = np.moveaxis(coefficients, -2, 0)
    return 0.25 * np.stack([c0 + c1 + c2 + c3, c0 - c1 + c2 - c3, c0 - c2, c1 - c3], axis=-2)
