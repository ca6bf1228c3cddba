"""Products of vectors of three numbers in plain Python, which is several times faster than NumPy for single vectors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray, Vec3


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross product of two (3,) arrays.

    Returns
    -------
    (3,) array
        ``a x b``, faster than by `numpy.cross`.
    """
    return np.array(cross_product(a.tolist(), b.tolist()))


def cross_product(a: Sequence[float], b: Sequence[float]) -> Vec3:
    """Return the cross product of two triples of Python floats."""
    ax, ay, az = a
    bx, by, bz = b
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def dot_product(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the scalar product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def length(a: FloatArray) -> float:
    """Return the length of a (3,) array."""
    x, y, z = a.tolist()
    return math.sqrt(x * x + y * y + z * z)
