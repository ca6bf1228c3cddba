"""Weak gradient elimination (WGE): keeps strong edges of the spacecraft, removes the Earth's texture and noise.

Sharma, Ventura & D'Amico (2018), J. Spacecraft and Rockets, doi 10.2514/1.A34124, image processing, WGE. The
histogram of the normalised gradient magnitude is modelled as an exponential distribution, ``F(g) = 1 - exp(-g /
mean)``; gradients below the threshold ``g* = -mean ln(1 - 0.99)`` are eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import cv2
import numpy as np

Array = np.ndarray

# Prewitt operator of the x derivative, scaled so that a ramp of slope 1 gives 1.
_PREWITT = np.array([[-1, 0, 1], [-1, 0, 1], [-1, 0, 1]], np.float32) / 6.0


@dataclass(frozen=True, eq=False)
class WeakGradientElimination:
    """Gradient magnitude 0..1 with its histogram, the threshold, and the surviving pixels.

    Parameters
    ----------
    magnitude : (h, w) array
        Gradient magnitude as a share of its maximum.
    strong : (h, w) array
        True where the magnitude exceeds the threshold.
    threshold : float
        Threshold of the normalised magnitude.
    counts : (bins,) array
        Histogram of the normalised magnitude.
    """

    magnitude: Array
    strong: Array
    threshold: float
    counts: Array


def exponential_threshold(counts: Array, cdf: float) -> float:
    """Return the value at which the CDF of an exponential fitted to a histogram over 0..1 reaches ``cdf``.

    The maximum-likelihood estimate of an exponential's scale is the mean: threshold = -ln(1 - cdf) x mean, which is
    4.605 x mean at 0.99.
    """
    total = float(counts.sum())
    if total <= 0:
        return 1.0
    centres = (np.arange(len(counts)) + 0.5) / len(counts)
    mean = float((counts * centres).sum()) / total
    return float(min(1.0, -np.log(1.0 - cdf) * mean))


def prewitt(image: Array) -> Tuple[Array, Array]:
    """Return Prewitt's derivatives along x and y of a float32 image, per pixel."""
    gx = cv2.filter2D(image, cv2.CV_32F, _PREWITT)
    return gx, cv2.filter2D(image, cv2.CV_32F, np.ascontiguousarray(_PREWITT.T))


def eliminate_weak_gradients(
    image: Array, blur_px: float = 1.0, bins: int = 100, cdf: float = 0.99
) -> WeakGradientElimination:
    """Blur, compute Prewitt magnitudes, normalise, fit the histogram and threshold.

    Parameters
    ----------
    image : (h, w) array
        Image, float32, in any unit.
    blur_px : float, optional
        Standard deviation of the Gaussian blur [px].
    bins : int, optional
        Number of bins of the gradient histogram.
    cdf : float, optional
        Value of the fitted distribution function at the threshold.
    """
    blurred = cv2.GaussianBlur(image, (0, 0), blur_px)
    gx, gy = prewitt(blurred)
    magnitude = cv2.magnitude(gx, gy)
    top = float(magnitude.max())
    if top <= 0:
        flat = np.zeros(image.shape, np.float32)
        return WeakGradientElimination(flat, flat > 0, 1.0, np.zeros(bins))
    magnitude = magnitude / np.float32(top)
    counts = cv2.calcHist([magnitude], [0], None, [bins], [0.0, 1.0 + 1e-6]).ravel()
    threshold = exponential_threshold(counts, cdf)
    return WeakGradientElimination(magnitude, magnitude > threshold, threshold, counts)
