"""Input of the pose proposal network: crops of the image and their contrast, in C."""

from __future__ import annotations

import ctypes
from typing import Optional

import numpy as np

from hil.board.svd.native.backend import address, laid
from hil.board.svd.native.images.area_average import region

Array = np.ndarray

# Side of the neighbourhood of the contrast channel [px], as in net.py.
CONTRAST_PX = 13


def seen_through(
    library: ctypes.CDLL,
    image: Array,
    reduced: Optional[Array],
    intrinsics: Array,
    gazes: Array,
    side_px: int,
    sphere_px: float,
) -> Array:
    """(N, side, side) float32, as ``crop.seen_through`` of a camera without distortion.

    Parameters
    ----------
    image : a picture that is ``area.readable``. intrinsics : fx fy cx cy. gazes : (N, 4) directions and diameters.
    """
    whole = None if reduced is None else laid(reduced, "float32")
    if min(image.shape) < 2 or (whole is not None and min(whole.shape) < 2):
        raise ValueError("a picture for the first look must have two rows and two columns")
    camera, given = laid(np.asarray(intrinsics), "float64"), laid(gazes.reshape(-1, 4), "float64")
    out = np.empty((len(given), side_px, side_px), np.float32)
    run, at, n = library.fly_seen_through, ctypes.c_void_p, ctypes.c_int64
    run.restype = n
    failed = run(
        *region(image),
        None if whole is None else at(address(whole, "float32")),
        *((n(0), n(0)) if whole is None else (n(whole.shape[0]), n(whole.shape[1]))),
        at(address(camera, "float64", (4,))),
        at(address(given, "float64", (len(given), 4))),
        n(len(given)),
        n(side_px),
        ctypes.c_double(sphere_px),
        at(address(out, "float32")),
    )
    if failed:
        raise MemoryError("no memory for the first look")
    return out


def contrast(library: ctypes.CDLL, pictures: Array, noise: Array) -> Array:
    """As ``net.contrast``; pictures (B, n, n) with their noise (B,)."""
    shown, sigma = laid(pictures, "float32"), laid(noise, "float32")
    count, n = shown.shape[:2]
    if n < CONTRAST_PX:
        raise ValueError(f"a picture for the first look has {CONTRAST_PX} rows at least, not {n}")
    out = np.empty((count, n, n, 2), np.float32)
    run, at = library.fly_contrast, ctypes.c_void_p
    run.restype = ctypes.c_int64
    if run(
        at(address(shown, "float32", (count, n, n))),
        at(address(sigma, "float32", (count,))),
        ctypes.c_int64(count),
        ctypes.c_int64(n),
        at(address(out, "float32")),
    ):
        raise MemoryError("no memory for the first look")
    return out
