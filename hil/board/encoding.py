"""Conversion of encoded images to linear ones: estimators need light, and many cameras deliver a curve of it."""

from __future__ import annotations

from typing import Dict

import numpy as np

Array = np.ndarray

GAMMA = 2.2
"""Exponent of ``gamma``: light is the pixel value, 1 at full scale, to this power."""


def _srgb_light(y: Array) -> Array:
    # IEC 61966-2-1:1999
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)


_NUMBERS = np.arange(256) / 255
_LIGHT: Dict[str, Array] = {"srgb": _srgb_light(_NUMBERS), "gamma": _NUMBERS**GAMMA}
"""Light of each 8-bit value, 1 at full scale, by the name of the encoding."""
ENCODINGS = ("linear", *_LIGHT)


def light_of(image: Array, encoding: str) -> Array:
    """Return the light of an image in its own units: the image itself if linear, else 0 to 255 in float32.

    Parameters
    ----------
    image : array
        Of any shape; an encoded one has uint8 pixels.
    encoding : str
        One of ``ENCODINGS``, as the camera object names it.

    Raises
    ------
    ValueError
        If the encoding is unknown, or an image that is not linear has pixels of another type.
    """
    if encoding == "linear":
        return image
    if encoding not in _LIGHT:
        raise ValueError(f"encoding {encoding!r} is unknown: {', '.join(ENCODINGS)} are known")
    if image.dtype != np.uint8:
        raise ValueError(f"{encoding} pixels have 8 bits, these are {image.dtype}")
    return (255 * _LIGHT[encoding]).astype(np.float32)[image]


def linear_picture(image: Array, encoding: str) -> Array:
    """Return an image whose values are proportional to light, of the same type; see `light_of` for what is refused."""
    return image if encoding == "linear" else np.rint(light_of(image, encoding)).astype(np.uint8)
