"""Blur and response of the camera as structures of the native library."""

from __future__ import annotations

import functools

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry import response
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.response import Response
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure

Array = np.ndarray

# Largest radius of a blur kernel in the library [px].
MAX_RADIUS_PX = 64

# Standard deviation below which a blur is skipped [px].
MIN_BLUR_SIGMA_PX = 0.2


def blur_reach(sigma_px: float) -> int:
    """Return the radius of OpenCV's Gaussian kernel for float images [px]."""
    return (int(np.rint(8 * sigma_px + 1)) | 1) // 2 if sigma_px > MIN_BLUR_SIGMA_PX else 0


@functools.lru_cache(maxsize=256)
def gaussian(sigma_px: float) -> Structure:
    """Return OpenCV's Gaussian kernel; one of radius 0 below ``MIN_BLUR_SIGMA_PX``.

    Raises
    ------
    ValueError
        If the radius exceeds the library's limit.
    """
    r = blur_reach(sigma_px)
    if r > MAX_RADIUS_PX:
        raise ValueError(f"the library blurs by {MAX_RADIUS_PX} px at most, not {r}")
    taps = cv2.getGaussianKernel(2 * r + 1, sigma_px, cv2.CV_32F) if r else np.ones(1, np.float32)
    return STRUCTURES["gaussian"](taps=np.ascontiguousarray(taps, np.float32), reach=r)


def blurred(image: Array, sigma: float) -> Array:
    """Return an image (h, w) or (h, w, channels) after a Gaussian blur, unchanged below ``MIN_BLUR_SIGMA_PX``."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > MIN_BLUR_SIGMA_PX else image


@functools.lru_cache(maxsize=16)
def response_tables(curve: Response) -> Structure:
    """Return the camera response with its tables as a structure."""
    lift, share = (np.ascontiguousarray(a, np.float32) for a in response.tables())
    x, below = (np.ascontiguousarray(curve.sigma * a, np.float64) for a in response.means())
    end = round(curve.full_scale * response.STEPS_PER_SIGMA / curve.sigma) if curve.sigma > 0 else 0
    return STRUCTURES["response"](
        sigma=float(curve.sigma),
        full=float(curve.full_scale),
        lift=lift,
        share=share,
        x=x,
        below=below,
        entries=len(x),
        end=min(end, 1 << 40),
    )


def pinhole_view(camera: CameraIntrinsics, patch: ImagePatch) -> Structure:
    """Return the pinhole view of a patch as a structure."""
    across, down = patch.scale
    return STRUCTURES["view"](
        fx=camera.fx_px,
        fy=camera.fy_px,
        cx=camera.cx_px,
        cy=camera.cy_px,
        x0=patch.x0,
        y0=patch.y0,
        across=across,
        down=down,
    )
