"""Checked values of untrusted JSON: finite numbers, indices, and compressed data of a limited size."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np

Array = np.ndarray

BAD_VALUE = (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError)
"""Exceptions of a field that is missing, or has another type or an impossible value."""

# Largest magnitude of a number, as of a position on the link: squares and sums of smaller ones stay finite
LARGEST = 1e9

# Smallest length that counts as positive [m].
SMALLEST_M = 1e-12

# Limit of unpacked data [bytes], a hundred times what a built-in target has.
MAX_UNPACKED_BYTES = 1 << 24


def numbers(value: Any, *shape: int) -> Array:  # noqa: ANN401 - parsed JSON
    """Return nested lists of numbers as a float array of this shape; one axis may be -1.

    Raises
    ------
    OverflowError, TypeError, ValueError
        If the shape is another one, or a number is not finite or above ``LARGEST``.
    """
    array = np.asarray(value, dtype=float).reshape(shape)
    if not np.all(np.abs(array) <= LARGEST):
        raise ValueError(f"every number must be finite and within {LARGEST:g}")
    return array


def number(value: Any, least: float = -LARGEST) -> float:  # noqa: ANN401 - parsed JSON
    """Return a finite number that is at least ``least``. Raises as `numbers` does."""
    checked = float(numbers(value))
    if checked < least:
        raise ValueError(f"{checked:g} is too small, at least {least:g} is needed")
    return checked


def whole(value: Any) -> int:  # noqa: ANN401 - parsed JSON
    """Return a whole number; 640.0 is one.

    Raises
    ------
    OverflowError, TypeError, ValueError
        If it is none.
    """
    checked = int(value)
    if checked != value:
        raise ValueError(f"{value!r} is not a whole number")
    return checked


def indices(value: Any, *shape: int) -> Array:  # noqa: ANN401 - parsed JSON
    """Return nested lists of integers as an array of this shape; one axis may be -1.

    Raises
    ------
    ValueError
        If there is anything but integers of 64 bits, or the shape is another one.
    """
    array = np.asarray(value)
    if array.size and array.dtype.kind != "i":
        raise ValueError("an index is not a whole number, or too large")
    return array.astype(np.intp).reshape(shape)


def unpack(text: str, n_bytes: int) -> bytes:
    """Return exactly ``n_bytes`` from base64 of a zlib stream, without unpacking more.

    Raises
    ------
    ValueError
        If the stream is damaged or holds another number of bytes, or ``n_bytes`` exceeds ``MAX_UNPACKED_BYTES``.
    """
    if not 0 < n_bytes <= MAX_UNPACKED_BYTES:
        raise ValueError(f"packed data of {n_bytes} bytes, allowed: 1 to {MAX_UNPACKED_BYTES}")
    stream = zlib.decompressobj()
    try:
        data = stream.decompress(base64.b64decode(text, validate=True), n_bytes)
        surplus = stream.decompress(stream.unconsumed_tail, 1)
    except zlib.error as error:
        raise ValueError(f"packed data cannot be unpacked: {error}") from error
    if len(data) != n_bytes or surplus or not stream.eof:
        raise ValueError(f"packed data hold {'more' if surplus else len(data)} bytes instead of {n_bytes}")
    return data
