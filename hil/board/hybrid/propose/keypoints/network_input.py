"""Input of the keypoint network: an image crop as two exposure-invariant channels."""

from __future__ import annotations

import cv2
import numpy as np

Array = np.ndarray

# Side of the input [px], and share of it that the bounding sphere fills in a correct crop.
INPUT_PX, INPUT_FILL = 128, 0.72

# Side of the neighbourhood of the contrast channel [px].
NEIGHBOURHOOD_PX = 23

# Share of pixels above the reference level of brightness.
BRIGHT_SHARE = 0.005

# Floors of the normalisation: brightness and contrast [standard deviations of the noise], share of the reference level.
MIN_BRIGHTNESS_SIGMA, MIN_CONTRAST_SIGMA, MIN_LEVEL_SHARE = 6.0, 2.0, 0.004


def channels(pictures: Array, noise: Array) -> Array:
    """Return the brightness and local contrast of crops.

    Parameters
    ----------
    pictures : (B, S, S) array
        Crops, float32, of any scale.
    noise : (B,) array
        Standard deviation of each crop's noise.

    Returns
    -------
    (B, 2, S, S) array
        Square root of the brightness relative to the brightest part, -0.3 to 0.8, and contrast relative to the local
        one, -1.5 to 1.5; float32.
    """
    out = np.empty((len(pictures), 2, *pictures.shape[1:]), np.float32)
    side = (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX)
    for picture, sigma, channels_out in zip(pictures, noise, out):  # noqa: B905 - Python 3.9 has no strict=
        top = np.partition(picture.ravel(), -1 - int(BRIGHT_SHARE * picture.size))[
            -1 - int(BRIGHT_SHARE * picture.size)
        ]
        bright = max(float(top), MIN_BRIGHTNESS_SIGMA * float(sigma), 1e-9)
        channels_out[0] = np.sqrt(np.clip(picture * np.float32(1 / bright), 0.0, 1.2)) - np.float32(0.3)
        contrast = picture - cv2.blur(picture, side)
        least = (MIN_CONTRAST_SIGMA * float(sigma) + MIN_LEVEL_SHARE * bright) ** 2
        spread = np.sqrt(cv2.blur(contrast * contrast, side) + np.float32(least))
        channels_out[1] = np.clip(0.5 * contrast / spread, -1.5, 1.5)
    return out
