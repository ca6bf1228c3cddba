"""Linear pictures from encoded ones: estimators reason about light, and many cameras deliver a curve of it."""

from __future__ import annotations

from typing import Dict

import numpy as np

Array = np.ndarray

GAMMA = 2.2
"""Exponent of ``gamma``: light is the number, 1 at full scale, to this power."""


def _srgb_light(y: Array) -> Array:
    # IEC 61966-2-1:1999
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)


_NUMBERS = np.arange(256) / 255
_LIGHT: Dict[str, Array] = {"srgb": _srgb_light(_NUMBERS), "gamma": _NUMBERS**GAMMA}
"""Light of each number of eight bits, 1 at full scale, by the name of the encoding."""
ENCODINGS = ("linear", *_LIGHT)


def light_of(image: Array, encoding: str) -> Array:
    """Return the light of a picture in its own units: the picture itself if it is linear, else 0 to 255 in float32.

    Parameters
    ----------
    image : array
        Of any shape; an encoded one has uint8 pixels.
    encoding : str
        One of ``ENCODINGS``, as the camera object names it.

    Raises
    ------
    ValueError
        If the encoding is unknown, or a picture that is not linear has pixels of another type.
    """
    if encoding == "linear":
        return image
    if encoding not in _LIGHT:
        raise ValueError(f"encoding {encoding!r} is unknown: {', '.join(ENCODINGS)} are known")
    if image.dtype != np.uint8:
        raise ValueError(f"{encoding} pixels have 8 bits, these are {image.dtype}")
    return (255 * _LIGHT[encoding]).astype(np.float32)[image]


def linear_picture(image: Array, encoding: str) -> Array:
    """Return a picture whose numbers are in proportion to light, of the same type; `light_of` says what is refused."""
    return image if encoding == "linear" else np.rint(light_of(image, encoding)).astype(np.uint8)
