"""Noise of an 8-bit image, in C."""

from __future__ import annotations

import ctypes
from typing import Tuple

import numpy as np

from hil.board.svd.native.images.area_average import region

Array = np.ndarray


def noise_medians(
    library: ctypes.CDLL, image: Array, step: int, full_scale: float
) -> Tuple[float, int, float]:
    """Median of Immerkaer's mask, number of pixels well inside the scale, and the median over them.

    Parameters
    ----------
    image : (H, W) of bytes, ``area.readable``, three rows and columns at least. step : strips of three rows from one
        that is looked at to the next.
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
