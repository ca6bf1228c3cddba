"""Area averages of an image, in C."""

from __future__ import annotations

import ctypes

import numpy as np

Array = np.ndarray

# Pixels that a kernel reads.
KINDS = ("uint8", "uint16", "float32")


def readable(image: Array) -> bool:
    """Whether a kernel reads this picture or part of one where it lies: rows may be apart, their pixels not."""
    return bool(
        image.ndim == 2
        and image.dtype.name in KINDS
        and image.dtype.isnative
        and image.flags.aligned
        and image.size
        and image.strides[1] == image.itemsize
        and image.strides[0] >= image.shape[1] * image.itemsize
        and image.strides[0] % image.itemsize == 0
    )


def region(image: Array) -> tuple:  # type: ignore[type-arg]
    """First pixel, bytes of one, pixels from row to row, rows, and columns of a ``readable`` picture."""
    at = ctypes.c_void_p(image.__array_interface__["data"][0])
    stride = image.strides[0] // image.itemsize
    return at, *(ctypes.c_int64(n) for n in (image.itemsize, stride, *image.shape))


def area_average(library: ctypes.CDLL, image: Array, width: int, height: int) -> Array:
    """(height, width) float32 of a ``readable`` picture that is no smaller; rounded where that holds whole numbers."""
    if not (0 < height <= image.shape[0] and 0 < width <= image.shape[1]):
        raise ValueError(f"a kernel reduces, not {image.shape} to {height, width}")
    out = np.empty((height, width), np.float32)
    run = library.fly_area_average
    run.restype = ctypes.c_int64
    if run(*region(image), ctypes.c_int64(height), ctypes.c_int64(width), ctypes.c_void_p(out.ctypes.data)):
        raise MemoryError("no memory to reduce a picture")
    return out
