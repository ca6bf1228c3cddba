"""A camera's output from the detector's digital numbers: unchanged, or encoded with 8 bits.

Most colour cameras convert with more bits, subtract the black level and deliver 8 encoded bits. For sRGB a colour
matrix first converts the detector's bands to sRGB's primaries. Linear images and raw mosaics are delivered unchanged.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from flyaround.simulator.camera.detector.sensor import Sensor, with_bits
from flyaround.simulator.camera.encoding import decode, encode

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.encoding import Encoding

ENCODED_BITS = 8
"""Bit depth of an encoded image."""
CONVERTER_BITS = 14
"""Bit depth before encoding. A step of 14 bits is a fifth of the first 8-bit step of sRGB."""


def default_encoding(sensor: Sensor, bands: str) -> Encoding:
    """Return the default encoding of a sensor's images.

    Returns
    -------
    str
        ``srgb`` for colour images of 8 bits that are no raw mosaic, else ``linear``.
    """
    return "srgb" if bands == "rgb" and encoding_problem("srgb", sensor) is None else "linear"


def encoding_problem(encoding: Encoding, sensor: Sensor) -> str | None:
    """Describe why a sensor's images cannot have an encoding.

    Returns
    -------
    str or None
        Reason, with what is allowed; None if they can.
    """
    if encoding == "linear":
        return None
    if sensor.bits != ENCODED_BITS:
        return (
            f"output.encoding is {encoding} and sensor.bits {sensor.bits}, allowed: {ENCODED_BITS} bits, or linear; "
            "a curve is defined only for 8 bits"
        )
    detector = sensor.detector
    if detector is not None and detector.colour_filter != "none" and not detector.demosaic:
        return f"output.encoding is {encoding}, allowed: linear, because the mosaic of a colour filter is raw"
    return None


def converter(sensor: Sensor, encoding: Encoding) -> Sensor:
    """Return the sensor before encoding.

    Returns
    -------
    Sensor
        ``sensor`` itself for linear images, else a copy with 14 bits.
    """
    return sensor if encoding == "linear" else with_bits(sensor, CONVERTER_BITS)


def encode_numbers(
    numbers: NDArray[np.unsignedinteger], sensor: Sensor, encoding: Encoding
) -> NDArray[np.unsignedinteger]:
    """Encode the converter's numbers as the camera delivers them.

    Parameters
    ----------
    numbers : (H, W) or (H, W, 3) array
        Digital numbers of the sensor that `converter` returns, white balanced.
    sensor : Sensor
        Sensor of the camera.
    encoding : str
        Encoding of the delivered image; with ``linear``, ``numbers`` are returned unchanged.

    Returns
    -------
    array
        Encoded numbers of the delivered depth.
    """
    if encoding == "linear":
        return numbers
    if numbers.ndim == 3 and encoding == "srgb":
        numbers = np.asarray(cv2.transform(numbers, np.array(SRGB_FROM_BANDS)), np.uint16)
    return np.asarray(_curve(encoding, _black_dn(converter(sensor, encoding)))[numbers])


def decode_numbers(
    image: NDArray[np.unsignedinteger], sensor: Sensor, encoding: Encoding
) -> tuple[NDArray[np.unsignedinteger], Sensor]:
    """Decode a delivered image to linear digital numbers, and return them with the sensor whose scale they have.

    A colour image in sRGB is decoded to the primaries of sRGB, not to the detector's bands.

    Parameters
    ----------
    image : array
        Image as the camera delivers it.
    sensor : Sensor
        Sensor of the camera.
    encoding : str
        Encoding of the image; with ``linear``, ``image`` and ``sensor`` are returned unchanged.

    Returns
    -------
    array
        Linear digital numbers.
    Sensor
        Sensor whose scale they have.
    """
    if encoding == "linear":
        return image, sensor
    linear_sensor = converter(sensor, encoding)
    black = _black_dn(linear_sensor)
    numbers = black + decode(np.arange(256) / 255, encoding) * (2**CONVERTER_BITS - 1 - black)
    return np.rint(numbers).astype(np.uint16)[image], linear_sensor


def _black_dn(sensor: Sensor) -> float:
    return sensor.scale_dn[1]


@lru_cache(maxsize=16)
def _curve(encoding: Encoding, black_dn: float) -> NDArray[np.uint8]:
    """Return the (65536,) look-up table from the converter's numbers to delivered ones."""
    largest_dn = 2**CONVERTER_BITS - 1
    light = np.clip((np.arange(1 << 16) - black_dn) / (largest_dn - black_dn), 0, 1)
    return np.rint(encode(light, encoding) * 255).astype(np.uint8)
