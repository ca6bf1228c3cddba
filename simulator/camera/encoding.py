"""Transfer functions of an image, between linear light and digital numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

Encoding = Literal["linear", "srgb", "gamma"]

GAMMA = 2.2
"""Exponent of the encoding ``gamma``: light is the relative number to this power."""


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
    linear = np.asarray(light, float)
    if encoding == "srgb":
        return np.where(
            # IEC 61966-2-1:1999
            linear <= 0.0031308,
            12.92 * linear,
            1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055,
        )
    return linear ** (1 / GAMMA) if encoding == "gamma" else linear


def decode(value: ArrayLike, encoding: Encoding) -> FloatArray:
    """Decode numbers to light, both 1 at full scale; the inverse of `encode`.

    Returns
    -------
    array
        Linear light of the shape of ``value``. For ``linear`` it may be the given array itself.
    """
    encoded = np.asarray(value, float)
    if encoding == "srgb":
        # IEC 61966-2-1:1999
        return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return encoded**GAMMA if encoding == "gamma" else encoded


def step_share(signal: ArrayLike, encoding: Encoding) -> FloatArray:
    """Return the size in light of an 8-bit step of an encoded image at a signal.

    Returns
    -------
    array
        Size relative to full scale, of the shape of ``signal``.
    """
    number = np.rint(encode(np.clip(signal, 0, 1), encoding) * 255)
    light_below, light_above = (
        decode(np.maximum(number - 0.5, 0) / 255, encoding),
        decode((number + 0.5) / 255, encoding),
    )
    return np.asarray(light_above - light_below)
