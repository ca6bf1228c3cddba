"""Image regions that the native library reads without a copy."""

from __future__ import annotations

from typing import Tuple

import numpy as np

Array = np.ndarray

# Pixel types that the library reads.
PIXEL_TYPES = ("uint8", "uint16", "float32")


def library_reads(image: Array) -> bool:
    """Return True if the library can read this image in place: rows may be strided, pixels of a row contiguous."""
    return bool(
        image.ndim == 2
        and image.dtype.name in PIXEL_TYPES
        and image.dtype.isnative
        and image.flags.aligned
        and image.size
        and image.strides[1] == image.itemsize
        and image.strides[0] >= image.shape[1] * image.itemsize
        and image.strides[0] % image.itemsize == 0
    )


def region(image: Array) -> Tuple[int, int, int, int, int]:
    """Return address, bytes per pixel, row stride in pixels, rows and columns of an image."""
    first = image.__array_interface__["data"][0]
    return first, image.itemsize, image.strides[0] // image.itemsize, image.shape[0], image.shape[1]
