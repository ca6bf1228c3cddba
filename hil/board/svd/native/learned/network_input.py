"""Input of the pose proposal network: crops of the image and their contrast, in C."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Optional, Sequence

import numpy as np

from flyaround.hil.board.svd.native.arrays import checked_pointer, contiguous
from flyaround.hil.board.svd.native.images.image_functions import region

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics

Array = np.ndarray

# Side of the neighbourhood of the contrast channel [px], as in network.py.
CONTRAST_PX = 13


def crop_images(
    library: ctypes.CDLL,
    image: Array,
    camera: CameraIntrinsics,
    crops: Sequence[Any],
    side_px: int,
    sphere_px: float,
    reduced: Optional[Array] = None,
) -> Array:
    """As ``network_input.crop_images`` of a camera without distortion and an image that is ``readable``."""
    whole = None if reduced is None else contiguous(reduced, "float32")
    if min(image.shape) < 2 or (whole is not None and min(whole.shape) < 2):
        raise ValueError("an image to crop must have two rows and two columns")
    intrinsics = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    given = np.array([[*c.direction, c.diameter_px] for c in crops], float).reshape(-1, 4)
    out = np.empty((len(given), side_px, side_px), np.float32)
    run, at, n = library.fly_crop_images, ctypes.c_void_p, ctypes.c_int64
    run.restype = n
    failed = run(
        *region(image),
        None if whole is None else at(checked_pointer(whole, "float32")),
        *((n(0), n(0)) if whole is None else (n(whole.shape[0]), n(whole.shape[1]))),
        at(checked_pointer(intrinsics, "float64", (4,))),
        at(checked_pointer(given, "float64", (len(given), 4))),
        n(len(given)),
        n(side_px),
        ctypes.c_double(sphere_px),
        at(checked_pointer(out, "float32")),
    )
    if failed:
        raise MemoryError("no memory to crop an image")
    return out


def contrast(library: ctypes.CDLL, pictures: Array, noise: Array) -> Array:
    """As ``network.contrast``; crops (B, n, n) with their noise (B,)."""
    shown, sigma = contiguous(pictures, "float32"), contiguous(np.asarray(noise), "float32")
    count, n = shown.shape[:2]
    if n < CONTRAST_PX:
        raise ValueError(f"an input of the network has {CONTRAST_PX} rows at least, not {n}")
    out = np.empty((count, n, n, 2), np.float32)
    run, at = library.fly_contrast, ctypes.c_void_p
    run.restype = ctypes.c_int64
    if run(
        at(checked_pointer(shown, "float32", (count, n, n))),
        at(checked_pointer(sigma, "float32", (count,))),
        ctypes.c_int64(count),
        ctypes.c_int64(n),
        at(checked_pointer(out, "float32")),
    ):
        raise MemoryError("no memory for the network's input")
    return out
