"""Mipmap levels of slopes, with the deviation from the mean inside each texel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import FloatArray


def slope_levels(image: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield each level of a square image down to one texel, with (S, S) root mean squares of its slopes' deviations.

    Parameters
    ----------
    image : (S, S, n) array
        S a power of two; slopes along u and v, and other channels.

    References
    ----------
    Olano & Baker (2010), LEAN mapping, I3D.
    """
    square = (image[..., :2] ** 2).sum(axis=2, keepdims=True)
    while True:
        variance = square[..., 0] - (image[..., :2] ** 2).sum(axis=2)
        yield image, np.sqrt(np.maximum(variance, 0))
        if len(image) == 1:
            return
        image, square = _halve(image), _halve(square)


def _halve(image: FloatArray) -> FloatArray:
    """Return the mean of two by two texels."""
    half = len(image) // 2
    return np.asarray(image.reshape(half, 2, half, 2, -1).mean(axis=(1, 3)))
