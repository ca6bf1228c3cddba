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
    """Convert an array to an immutable triple of Python floats.

    Returns
    -------
    tuple of float
        The three values of the (3,) array.
    """
    x, y, z = map(float, values)
    return (x, y, z)


def quat(values: FloatArray) -> Quat:
    """Convert an array to an immutable quaternion of Python floats.

    Returns
    -------
    tuple of float
        The four values of the (4,) array, scalar first; they are not normalised.
    """
    w, x, y, z = map(float, values)
    return (w, x, y, z)
