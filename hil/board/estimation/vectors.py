"""Vector operations."""

from __future__ import annotations

import math

import numpy as np

Array = np.ndarray


def length(v: Array) -> float:
    """Return the length of one vector (N,). Faster than ``np.linalg.norm``."""
    return math.sqrt(v.dot(v))


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of ``a`` and ``b`` (..., 3) in float64. Faster than ``np.cross``."""
    if a.ndim == b.ndim == 1:
        # scalar arithmetic is much faster than arrays for a single pair
        (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
        return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    out = np.empty(np.broadcast(a, b).shape)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[..., i], b[..., j], out=out[..., k])
        out[..., k] -= a[..., j] * b[..., i]
    return out


def sphere_directions(count: int) -> Array:
    """Return (count, 3) nearly uniform unit vectors, a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    phi = np.pi * (1 + np.sqrt(5.0)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def swing(direction: Array) -> Array:
    """Return the shortest rotation from the boresight (+z) to a unit vector (3,).

    Returns
    -------
    (3, 3) array
        Rotation matrix whose third column is ``direction``. It is orthonormal unless ``direction`` is within 8 degrees
        of -z, where the rotation is not defined.
    """
    x, y, z = direction.tolist()
    c = 1.0 / (1.0 + max(z, -0.99))
    return np.array([[1 - x * x * c, -x * y * c, x], [-x * y * c, 1 - y * y * c, y], [-x, -y, z]])
