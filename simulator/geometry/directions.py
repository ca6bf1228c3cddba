"""Directions: points spread evenly over the sphere, and axes perpendicular to a unit vector."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


def sphere_directions(count: int) -> FloatArray:
    """Return nearly uniform unit vectors: the Fibonacci lattice (Gonzalez 2010, Mathematical Geosciences 42).

    Returns
    -------
    (count, 3) array
        Unit vectors in order of descending z.
    """
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = np.pi * (1 + np.sqrt(5.0)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)


def spherical_fibonacci(count: int, lowest_cosine: float = -1.0) -> FloatArray:
    """Return spherical Fibonacci points, uniform in solid angle over a cap about +z.

    Returns
    -------
    (count, 3) array
        Unit vectors in order of descending z, all above ``lowest_cosine``.
    """
    share, circle = _fibonacci_angles(count)
    c = 1 - share * (1 - lowest_cosine)
    s = np.sqrt(np.maximum(1 - c * c, 0))
    directions = np.empty((count, 3))
    directions[:, 0], directions[:, 1], directions[:, 2] = s * circle[0], s * circle[1], c
    return directions


@lru_cache(maxsize=16)
def _fibonacci_angles(count: int) -> tuple[FloatArray, FloatArray]:
    """Return the share of the cap above each spherical Fibonacci point, and the cosine and sine of its azimuth."""
    k = np.arange(count) + 0.5
    turn = k * np.pi * (3 - np.sqrt(5))
    return k / count, np.stack([np.cos(turn), np.sin(turn)])


def orthonormal_basis(z: FloatArray) -> FloatArray:
    """Complete a unit vector to an orthonormal basis.

    Returns
    -------
    (3, 3) array
        Rows: two unit vectors perpendicular to ``z``, then ``z``; a right-handed frame.
    """
    # scalar arithmetic, because a NumPy cross product of two vectors is far slower
    a, b, c = (float(v) for v in z)
    x, y, w = (b, -a, 0.0) if abs(c) < 0.9 else (0.0, c, -b)
    length = (x * x + y * y + w * w) ** 0.5
    x, y, w = x / length, y / length, w / length
    return np.array([[x, y, w], [b * w - c * y, c * x - a * w, a * y - b * x], [a, b, c]])


def view_basis(direction: ArrayLike) -> FloatArray:
    """Complete a unit vector to an orthonormal basis for a view along it.

    Returns
    -------
    (3, 3) array
        Rows: two unit vectors perpendicular to ``direction``, then ``direction``; a right-handed frame. The first is
        also perpendicular to the coordinate axis along which ``direction`` is shortest.
    """
    d = np.asarray(direction, float)
    axis = [0.0, 0.0, 0.0]
    axis[int(np.argmin(np.abs(d)))] = 1.0
    e1 = np.array(_cross(d.tolist(), axis))
    e1 /= np.linalg.norm(e1)
    return np.array([e1, _cross(d.tolist(), e1.tolist()), d])


def _cross(a: list[float], b: list[float]) -> list[float]:
    """Return the cross product of two lists, which is far faster than NumPy's for single vectors."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
