"""Directions spread evenly over the sphere."""

from __future__ import annotations

import numpy as np

from simulator.runtime.arrays import FloatArray


def sphere_directions(count: int) -> FloatArray:
    """(count, 3) unit vectors, nearly even: the Fibonacci lattice (Gonzalez 2010, Mathematical Geosciences 42)."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = np.pi * (1 + np.sqrt(5.0)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)
