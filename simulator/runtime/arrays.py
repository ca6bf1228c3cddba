"""Type aliases for arrays and tuples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
ByteArray = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Mat3 = tuple[Vec3, Vec3, Vec3]


def vec3(values: FloatArray) -> Vec3:
    """Return a (3,) array as an immutable triple of Python floats."""
    x, y, z = map(float, values)
    return (x, y, z)


def quat(values: FloatArray) -> Quat:
    """Return a (4,) array, scalar first, as an immutable tuple of Python floats."""
    w, x, y, z = map(float, values)
    return (w, x, y, z)
