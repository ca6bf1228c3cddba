"""Attitudes as classes: a fixed set spread evenly over SO(3), and the mean attitude of probabilities of them.

References
----------
Proenca & Gao (2020), Deep learning for spacecraft pose estimation from photorealistic rendering, ICRA (soft
classification of the attitude); Markley et al. (2007), Averaging quaternions, J. Guidance 30(4).
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.estimation.even_attitudes import even_attitudes

Array = np.ndarray

# Radius of the neighbourhood whose classes are averaged [steps from one to the next], and how many of the most probable
# classes are candidates for its centre.
NEAR_STEPS, CANDIDATES = 1.6, 24


def class_attitudes(n: int) -> Array:
    """Return the attitudes (n, 4) of ``n`` classes."""
    return even_attitudes(n)


def class_step_rad(n: int) -> float:
    """Return the distance of neighbouring classes [rad]: the side of a cube of 1/n of SO(3), whose volume is 8 pi^2."""
    return float((8 * np.pi**2 / n) ** (1 / 3))


def softmax(logits: Array) -> Array:
    """Return the probabilities (..., K) of the classes."""
    e = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))


def mean_attitude(probability: Array) -> Tuple[Array, float]:
    """Return the mean attitude (4,) of the most probable neighbourhood of classes, and its probability.

    A craft that looks alike from two sides has two of them; their mean would be neither.

    Parameters
    ----------
    probability : (K,) array
        Probabilities of the classes.
    """
    n = len(probability)
    grid = class_attitudes(n)
    candidates = np.argsort(-probability)[:CANDIDATES]
    near = np.abs(grid[candidates] @ grid.T) > np.cos(0.5 * min(NEAR_STEPS * class_step_rad(n), np.pi))
    total = near @ probability
    best = int(np.argmax(total))
    # the sign of a quaternion plays no part in its outer product
    among = grid[near[best]]
    moment = (among * probability[near[best]][:, None]).T @ among
    q = np.linalg.eigh(moment)[1][:, -1]
    return (-q if q[0] < 0 else q), float(total[best])
