"""Images for a screen: conversion of digital numbers to sRGB, with a photographic tone curve.

Screens expect sRGB values. Linear values look too dark, with too much contrast and saturation.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.camera.encoding import encode
from flyaround.simulator.imaging.image_formation import noise_sigma

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.encoding import Encoding
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

SHOULDER = 4.0
"""Shoulder s of the tone curve (1 + s) x / (s + x) for relative light x. It compresses highlights."""

TOE_SIGMAS = 3.0
"""Toe of the curve, in standard deviations of the dark noise, which sRGB would show as grain."""

_FULL_SCALE = 16_383
"""Full scale of light in 16 bits. It leaves headroom, as the colour matrix may amplify a primary four times."""


def display_picture(image: NDArray[np.unsignedinteger], sensor: Sensor, encoding: Encoding) -> ByteArray:
    """Return an image as displayed: sRGB, with a filmic toe and shoulder.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        Digital numbers as delivered by the camera.
    sensor : Sensor
        Sensor of that camera.
    encoding : Encoding
        Transfer function of that camera's images.

    Returns
    -------
    (H, W) or (H, W, 3) uint8 array
    """
    light, display_table = _light_table(sensor, encoding), _display_table(sensor)
    if image.ndim == 2 or encoding == "srgb":
        return np.asarray(display_table[light][image])
    # the camera's three 100 nm bands are not a screen's primaries; sRGB images are already converted
    return np.asarray(display_table[cv2.transform(light[image], np.array(SRGB_FROM_BANDS))])


def screen_values(light: FloatArray) -> FloatArray:
    """Convert linear light to sRGB numbers by the tone curve.

    Returns
    -------
    array
        Numbers 0 to 1, of the shape of ``light``; light above full scale gives 1.
    """
    x = np.clip(light, 0.0, 1.0)
    return encode((1 + SHOULDER) * x / (SHOULDER + x), "srgb")


def raw_picture(image: NDArray[np.unsignedinteger], bits: int) -> ByteArray:
    """Reduce an image's numbers to their upper eight bits.

    Returns
    -------
    array
        Copy of the shape of ``image``, uint8; numbers of up to 8 bits are unchanged.
    """
    return np.asarray(image >> max(bits - 8, 0), np.uint8)


@lru_cache(maxsize=32)
def _light_table(sensor: Sensor, encoding: Encoding) -> NDArray[np.uint16]:
    """Return the light for each of an image's numbers, `_FULL_SCALE` at full scale."""
    numbers, linear = decode_numbers(np.arange(1 << sensor.bits, dtype=np.uint16), sensor, encoding)
    full, black = linear.scale_dn
    light = np.clip((numbers.astype(float) - black) / full, 0.0, 1.0)
    return np.rint(_FULL_SCALE * light).astype(np.uint16)


@lru_cache(maxsize=32)
def _display_table(sensor: Sensor) -> ByteArray:
    """Return the displayed number for each light, of `_FULL_SCALE` and above at full scale."""
    light = np.arange(1 << 16) / _FULL_SCALE
    toe = TOE_SIGMAS * noise_sigma(sensor)
    return np.rint(255 * screen_values(light * light * (1 + toe) / np.maximum(light + toe, 1e-9))).astype(
        np.uint8
    )
