"""Input of the keypoint network: a crop in two channels that do not depend on exposure."""

from __future__ import annotations

import cv2
import numpy as np

Array = np.ndarray

# Side of the input [px], and share of it that the target's bounding sphere fills when the crop is right.
INPUT_PX, INPUT_FILL = 128, 0.72

# Side of the neighbourhood of the contrast channel [px].
NEIGHBOURHOOD_PX = 23

# Share of the pixels brighter than the one that measures the level.
BRIGHT = 0.005

# Noise below which brightness and contrast are not amplified [standard deviations]; share of the brightest level.
LEAST_BRIGHT, LEAST_CONTRAST, LEAST_SHARE = 6.0, 2.0, 0.004


def channels(pictures: Array, noise: Array) -> Array:
    """Return (B, 2, S, S) float32 level and local contrast of crops.

    Parameters
    ----------
    pictures : (B, S, S) array
        Crops, float32, on any scale.
    noise : (B,) array
        Standard deviation of the noise of each.
    """
    out = np.empty((len(pictures), 2, *pictures.shape[1:]), np.float32)
    side = (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX)
    for picture, sigma, made in zip(pictures, noise, out):  # noqa: B905 - Python 3.9 has no strict=
        top = np.partition(picture.ravel(), -1 - int(BRIGHT * picture.size))[-1 - int(BRIGHT * picture.size)]
        bright = max(float(top), LEAST_BRIGHT * float(sigma), 1e-9)
        made[0] = np.sqrt(np.clip(picture * np.float32(1 / bright), 0.0, 1.2)) - np.float32(0.3)
        away = picture - cv2.blur(picture, side)
        least = (LEAST_CONTRAST * float(sigma) + LEAST_SHARE * bright) ** 2
        spread = np.sqrt(cv2.blur(away * away, side) + np.float32(least))
        made[1] = np.clip(0.5 * away / spread, -1.5, 1.5)
    return out
