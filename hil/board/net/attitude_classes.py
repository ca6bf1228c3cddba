"""Attitudes as classes: a fixed set of them spread evenly, and the one that shares among them stand for.

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

# How near to an attitude the classes are that are averaged [steps from one to the next], and how many of the likeliest
# are tried as a middle.
NEAR_STEPS, TRIED = 1.6, 24


def class_attitudes(n: int) -> Array:
    """(n, 4) the attitudes of ``n`` classes."""
    return even_attitudes(n)


def class_step_rad(n: int) -> float:
    """From one class to the next: the side of a class's share of all rotations, whose volume is 8 pi^2 [rad]."""
    return float((8 * np.pi**2 / n) ** (1 / 3))


def shares(logits: Array) -> Array:
    """(..., K) softmax: how likely each class is."""
    e = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))


def mean_attitude(likely: Array) -> Tuple[Array, float]:
    """(4,) attitude of the likeliest neighbourhood of classes, and the share 0..1 of it.

    A craft that looks alike from two sides has two of them; their mean would be neither.

    Parameters
    ----------
    likely : (K,) shares of the classes.
    """
    grid = class_attitudes(len(likely))
    tried = np.argsort(-likely)[:TRIED]
    near = np.abs(grid[tried] @ grid.T) > np.cos(0.5 * min(NEAR_STEPS * class_step_rad(len(likely)), np.pi))
    held = near @ likely
    best = int(np.argmax(held))
    # the sign of a quaternion plays no part in its outer product
    among = grid[near[best]]
    moment = (among * likely[near[best]][:, None]).T @ among
    q = np.linalg.eigh(moment)[1][:, -1]
    return (-q if q[0] < 0 else q), float(held[best])
