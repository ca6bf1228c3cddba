"""Attitude classes: a fixed, nearly uniform set on SO(3), and the mean attitude of class probabilities.

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

# Radius of the neighbourhood whose classes are averaged, in class spacings: more than the diagonal of a square of
# classes, so that an attitude between classes has its neighbours in all directions. Such a ball holds about 17 classes.
NEIGHBOURHOOD_STEPS = 1.6
# Number of most probable classes tried as its centre: more than one neighbourhood, so that the second side of a craft
# that looks alike from two sides is tried too.
CANDIDATES = 24


def class_attitudes(n: int) -> Array:
    """Return the attitudes of ``n`` classes.

    Returns
    -------
    (n, 4) array
        Quaternions, scalar first and of either sign, of the target relative to the line of sight to it; the row is the
        number of the class.
    """
    return even_attitudes(n)


def class_step_rad(n: int) -> float:
    """Return the spacing of ``n`` attitude classes.

    Returns
    -------
    float
        Spacing [rad]: the edge of a cube of 1/n of the volume of SO(3), 8 pi^2.
    """
    return float((8 * np.pi**2 / n) ** (1 / 3))


def softmax(logits: Array) -> Array:
    """Return the probabilities (..., K) of logits."""
    e = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))


def mean_attitude(probability: Array) -> Tuple[Array, float]:
    """Return the mean attitude (4,), scalar first, of the most probable neighbourhood of classes, and its probability.

    Averaging over all classes would fail for a craft that looks alike from two sides.

    Parameters
    ----------
    probability : (K,) array
        Probabilities of the classes.
    """
    n = len(probability)
    grid = class_attitudes(n)
    candidates = np.argsort(-probability)[:CANDIDATES]
    near = np.abs(grid[candidates] @ grid.T) > np.cos(
        0.5 * min(NEIGHBOURHOOD_STEPS * class_step_rad(n), np.pi)
    )
    total = near @ probability
    best = int(np.argmax(total))
    # the outer product does not depend on a quaternion's sign
    neighbours = grid[near[best]]
    moment = (neighbours * probability[near[best]][:, None]).T @ neighbours
    q = np.linalg.eigh(moment)[1][:, -1]
    return (-q if q[0] < 0 else q), float(total[best])
