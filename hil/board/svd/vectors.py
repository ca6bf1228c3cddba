"""Vectors in space, many at once."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def cross(a: Array, b: Array) -> Array:
    """Vector product (float64) of ``a`` and ``b`` (..., 3), to the last bit numpy's own, which takes twice as long."""
    out = np.empty(np.broadcast(a, b).shape)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[..., i], b[..., j], out=out[..., k])
        out[..., k] -= a[..., j] * b[..., i]
    return out
