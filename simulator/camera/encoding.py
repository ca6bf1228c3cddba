"""The transfer function of an image, between light and digital numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

Encoding = Literal["linear", "srgb", "gamma"]

GAMMA = 2.2
"""Exponent of ``gamma``: light is the relative number to this power."""


def encode(light: ArrayLike, encoding: Encoding) -> FloatArray:
    """Encode light as numbers, both 1 at full scale.

    Parameters
    ----------
    light : array
        Linear light, 0 to 1.
    encoding : str
        ``srgb`` is IEC 61966-2-1:1999, ``gamma`` a power of 1 / 2.2.

    Returns
    -------
    array
        Encoded numbers of the shape of ``light``, 0 to 1.
    """
    x = np.asarray(light, float)
    if encoding == "srgb":
        return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0) ** (1 / 2.4) - 0.055)
    return x ** (1 / GAMMA) if encoding == "gamma" else x


def decode(value: ArrayLike, encoding: Encoding) -> FloatArray:
    """Decode numbers to light, both 1 at full scale; the inverse of `encode`."""
    y = np.asarray(value, float)
    if encoding == "srgb":
        return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)
    return y**GAMMA if encoding == "gamma" else y


def step_share(signal: ArrayLike, encoding: Encoding) -> FloatArray:
    """Return the size of one step of an encoded image at a signal, relative to full scale."""
    number = np.rint(encode(np.clip(signal, 0, 1), encoding) * 255)
    low, high = decode(np.maximum(number - 0.5, 0) / 255, encoding), decode((number + 0.5) / 255, encoding)
    return np.asarray(high - low)
