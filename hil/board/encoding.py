"""Transfer functions: conversion of gamma- and sRGB-encoded images to linear ones, which the estimators need."""

from __future__ import annotations

from typing import Dict

import numpy as np

Array = np.ndarray

GAMMA = 2.2
"""Exponent of ``gamma``: relative light is the relative pixel value to this power."""


def _srgb_light(y: Array) -> Array:
    # IEC 61966-2-1:1999
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)


# All 8-bit pixel values, relative to full scale.
_NUMBERS = np.arange(256) / 255

_LIGHT: Dict[str, Array] = {"srgb": _srgb_light(_NUMBERS), "gamma": _NUMBERS**GAMMA}
"""Relative light of each 8-bit value, by encoding."""

ENCODINGS = ("linear", *_LIGHT)


def light_of(image: Array, encoding: str) -> Array:
    """Return an image's light: the image itself if it is linear, else float32 scaled to 0..255.

    Parameters
    ----------
    image : array
        Image of any shape, uint8 unless it is linear.
    encoding : str
        One of ``ENCODINGS``.

    Returns
    -------
    array
        Light of the image's shape.

    Raises
    ------
    ValueError
        If the encoding is unknown, or an encoded image is not uint8.
    """
    if encoding == "linear":
        return image
    if encoding not in _LIGHT:
        raise ValueError(f"encoding {encoding!r} is unknown: {', '.join(ENCODINGS)} are known")
    if image.dtype != np.uint8:
        raise ValueError(f"{encoding} pixels have 8 bits, these are {image.dtype}")
    return (255 * _LIGHT[encoding]).astype(np.float32)[image]


def linear_picture(image: Array, encoding: str) -> Array:
    """Return a linear image of the same type; raises as `light_of` does.

    Returns
    -------
    array
        The image itself if it is linear; otherwise its light, rounded, as a new uint8 array of the same shape.
    """
    return image if encoding == "linear" else np.rint(light_of(image, encoding)).astype(np.uint8)
