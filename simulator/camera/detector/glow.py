"""Glow about bright things: the wide tail of the point spread function, of light scattered by glass and dust."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.runtime.arrays import Float32Array

_STEP = 4  # pixels joined before so wide a blur: its error is far below a step of the picture
_WIDER = 3.0
"""The tail is two Gaussians of half the light each, the second so much wider: nearer to a tail's power law than one."""


def glow(image: Float32Array, optics: Optics) -> Float32Array:
    """The picture with ``glow_share`` of its light spread about; the same object where that is nothing.

    Parameters
    ----------
    image : (H, W) or (H, W, n) linear light. Beyond its border it is dark.
    """
    if optics.glow_share <= 0:
        return image
    height, width = image.shape[:2]
    small = cv2.resize(image, (-(-width // _STEP), -(-height // _STEP)), interpolation=cv2.INTER_AREA).astype(
        np.float32
    )
    tail = np.zeros_like(small)
    for factor in (1.0, _WIDER):
        sigma = max(factor * optics.glow_radius_px / _STEP, 0.5)
        tail += 0.5 * cv2.GaussianBlur(small, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    whole = cv2.resize(tail, (width, height), interpolation=cv2.INTER_LINEAR)
    share = np.float32(optics.glow_share)
    return np.asarray(image * (1 - share) + share * whole, np.float32)
