"""What the C of synthetic views shares: Gaussian blur, sensor response."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Tuple

import cv2
import numpy as np

from flyaround.hil.board.svd.geometry import response

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.response import Response

Array = np.ndarray

# Widest blur that C takes [px].
WIDEST = 64

# What is narrower is no blur [px].
LEAST_BLUR_PX = 0.2


class _Gaussian(ctypes.Structure):
    """image_formation.h: struct gaussian."""

    _fields_ = [("taps", ctypes.c_void_p), ("reach", ctypes.c_int64)]


class _Response(ctypes.Structure):
    """image_formation.h: struct response."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("sigma", "full")),
        *((name, ctypes.c_void_p) for name in ("lift", "share", "x", "below")),
        *((name, ctypes.c_int64) for name in ("entries", "end")),
    ]


@dataclass(frozen=True, eq=False)
class NativeStruct:
    """A C structure by reference, and the arrays that it points to, kept alive."""

    at: Any
    arrays: Tuple[Array, ...]


def blur_reach(sigma_px: float) -> int:
    """How far OpenCV's Gaussian of this width reaches in a float picture [px]."""
    return (int(np.rint(8 * sigma_px + 1)) | 1) // 2 if sigma_px > LEAST_BLUR_PX else 0


@functools.lru_cache(maxsize=256)
def gaussian(sigma_px: float) -> NativeStruct:
    """OpenCV's Gaussian; none where it is narrower than ``LEAST_BLUR_PX``.

    Raises
    ------
    ValueError
        If it is wider than a kernel takes.
    """
    r = blur_reach(sigma_px)
    if r > WIDEST:
        raise ValueError(f"a kernel blurs by {WIDEST} px at most, not {r}")
    taps = cv2.getGaussianKernel(2 * r + 1, sigma_px, cv2.CV_32F) if r else np.ones(1, np.float32)
    taps = np.ascontiguousarray(taps, np.float32)
    return NativeStruct(ctypes.byref(_Gaussian(taps.ctypes.data, r)), (taps,))


@functools.lru_cache(maxsize=16)
def response_tables(curve: Response) -> NativeStruct:
    """The response and its tables."""
    lift, share = (np.ascontiguousarray(a, np.float32) for a in response.tables())
    x, below = (np.ascontiguousarray(curve.sigma * a, np.float64) for a in response.means())
    end = round(curve.full * response.STEPS / curve.sigma) if curve.sigma > 0 else 0
    arrays = lift, share, x, below
    struct = _Response(
        float(curve.sigma), float(curve.full), *(a.ctypes.data for a in arrays), len(x), min(end, 1 << 40)
    )
    return NativeStruct(ctypes.byref(struct), arrays)
