"""Area averages, noise and straight line segments of an image, in C."""

from __future__ import annotations

import ctypes
from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous

Array = np.ndarray

# Pixel types that C reads.
KINDS = ("uint8", "uint16", "float32")

# The line segment detector's own settings: what it reduces an image to, its blur [px of that], and the least gradient
# that rounding to bytes cannot turn by its tolerance of directions.
REDUCED, SIGMA, LEAST = 0.8, 0.6, 2.0 / float(np.sin(np.radians(22.5)))


def readable(image: Array) -> bool:
    """Whether C can read this image, or region of one, in place: rows may be apart, the pixels of a row not."""
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
    """First pixel, bytes of one, pixels from row to row, rows, and columns of a ``readable`` image."""
    at = ctypes.c_void_p(image.__array_interface__["data"][0])
    stride = image.strides[0] // image.itemsize
    return at, *(ctypes.c_int64(n) for n in (image.itemsize, stride, *image.shape))


def area_average(library: ctypes.CDLL, image: Array, width: int, height: int) -> Array:
    """As ``edge_field.area_mean``, of a ``readable`` image that is no smaller."""
    if not (0 < height <= image.shape[0] and 0 < width <= image.shape[1]):
        raise ValueError(f"a kernel reduces, not {image.shape} to {height, width}")
    out = np.empty((height, width), np.float32)
    run = library.fly_area_average
    run.restype = ctypes.c_int64
    if run(*region(image), ctypes.c_int64(height), ctypes.c_int64(width), ctypes.c_void_p(out.ctypes.data)):
        raise MemoryError("no memory to reduce a picture")
    return out


def noise_medians(
    library: ctypes.CDLL, image: Array, step: int, full_scale: float
) -> Tuple[float, int, float]:
    """As ``noise._masked``, of a ``readable`` image.

    Parameters
    ----------
    image : (H, W) uint8, three rows and columns at least. step : strips of three rows from one used to the next.
    """
    if image.dtype != np.uint8 or min(image.shape) < 3:
        raise ValueError(
            f"a kernel takes bytes, three rows and columns at least, not {image.dtype} {image.shape}"
        )
    out = np.zeros(3)
    run = library.fly_noise
    run.restype = ctypes.c_int64
    if run(
        *region(image), ctypes.c_int64(step), ctypes.c_double(full_scale), ctypes.c_void_p(out.ctypes.data)
    ):
        raise MemoryError("no memory to measure noise")
    return float(out[0]), int(out[1]), float(out[2])


def detect_segments(library: ctypes.CDLL, picture: Array) -> Array:
    """As ``line_segments._lsd``: (N, 4) sub-pixel segments of an image of bytes."""
    return segments(library, _reduced(picture), LEAST) / REDUCED


def _reduced(picture: Array) -> Array:
    """The image as the line segment detector reduces it."""
    sigma = SIGMA / REDUCED
    taps = 1 + 2 * int(np.ceil(sigma * np.sqrt(6 * np.log(10.0))))
    smooth = cv2.GaussianBlur(picture, (taps, taps), sigma)
    return cv2.resize(smooth, None, fx=REDUCED, fy=REDUCED, interpolation=cv2.INTER_LINEAR_EXACT)


def segments(library: ctypes.CDLL, picture: Array, least: float) -> Array:
    """(N, 4) ends x0 y0 x1 y1 of straight segments [px, half a pixel right and down of the places of pixels].

    Parameters
    ----------
    picture : (H, W) of bytes; none are found in a single row or column. least : gradient that counts [1 / px].
    """
    given = contiguous(picture, "uint8")
    h, w = given.shape
    if min(h, w) < 2:
        return np.zeros((0, 4))
    # each has two pixels at least
    out = np.empty((h * w // 2, 4))
    run = library.fly_line_segments
    run.restype = ctypes.c_int64
    found = run(
        ctypes.c_void_p(checked_pointer(given, "uint8")),
        ctypes.c_int64(h),
        ctypes.c_int64(w),
        ctypes.c_double(least),
        ctypes.c_int64(len(out)),
        ctypes.c_void_p(checked_pointer(out, "float64")),
    )
    if found < 0:
        raise MemoryError("no memory to find segments")
    return out[:found].copy()
