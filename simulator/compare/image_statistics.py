"""Statistics of an image: histogram, Sobel gradient and its histogram, noise, binary edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

GRADIENT_BINS = 128  # bins of the histogram of gradients
# largest value of the gradient's histogram [DN/px]: a step of full scale along an axis. Larger ones, of at most
# 142.5 at diagonal steps, are counted in the last bin
MAX_GRADIENT_DN = 128.0
EDGE_BLUR_PX = 1.5  # standard deviation of the blur before binary edges [px]
MIN_EDGE_DN = 1e-3  # minimum threshold of binary edges [DN/px], above the rounding errors of a uniform image
BORDER_SHARE = 0.02  # width of the border that indicates the background, as a share of the height
DARK_LEVEL_DN = 15.0  # dark level, above the black level
SPACE_SHARE = 0.9  # share of dark border pixels above which the background is space
NOISE_BLOCK_PX = 16  # side of the blocks whose noise is measured, or the side of a smaller image [px]
# share of black pixels above which a block shows half of the noise: half way between unclipped noise, which has none,
# and noise clipped at its mean, which has one half
CLIPPED_SHARE = 0.25
# mean magnitude of the second difference of white noise clipped at its mean, over that of unclipped noise
HALF_NOISE = 0.56
# Immerkaer (1996, Computer Vision and Image Understanding 64): insensitive to planes and straight edges along the axes
_NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float64)


FIGURES = {
    "mean_dn": "mean [DN]",
    "black_dn": "1st percentile [DN]",
    "bright_dn": "99th percentile [DN]",
    "saturated": "share at 255",
    "noise_dn": "noise [DN]",
    "gradient_p50": "gradient, median [DN/px]",
    "gradient_p95": "gradient, 95 % [DN/px]",
    "gradient_p99": "gradient, 99 % [DN/px]",
    "edges": "share of binary edges",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ImageStatistics:
    """Statistics of one 8-bit grey image.

    Parameters
    ----------
    histogram : (256,) array
        Share of the pixels at each DN.
    gradient_histogram : (128,) array
        Share per DN per pixel of `sobel`.
    mean_dn : float
        Mean [DN].
    black_dn : float
        First percentile [DN].
    bright_dn : float
        99th percentile [DN].
    saturated : float
        Share of pixels at 255.
    noise_dn : float
        Standard deviation of the noise, from second differences (a median, robust against edges).
    gradient_p50 : float
        Median of the Sobel magnitude [DN per pixel].
    gradient_p95 : float
        95th percentile of the Sobel magnitude [DN per pixel].
    gradient_p99 : float
        99th percentile of the Sobel magnitude [DN per pixel].
    edges : float
        Share of the pixels in the binary edge image.
    space : bool
        True if the border is dark, so that the background is space. Any other is taken for the Earth.
    """

    histogram: FloatArray
    gradient_histogram: FloatArray
    mean_dn: float
    black_dn: float
    bright_dn: float
    saturated: float
    noise_dn: float
    gradient_p50: float
    gradient_p95: float
    gradient_p99: float
    edges: float
    space: bool

    def document(self) -> dict[str, float | str]:
        """Return the scalar figures as a JSON-able object."""
        return {name: round(float(getattr(self, name)), 5) for name in FIGURES} | {
            "background": "space" if self.space else "earth"
        }


def sobel(image: ByteArray | Float32Array) -> Float32Array:
    """Compute the magnitude of the 3 x 3 Sobel gradient, normalised to the slope of a plane.

    Returns
    -------
    (H, W) array
        Magnitude [DN per pixel], float32.
    """
    x = cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    y = cv2.Sobel(image, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
    return np.asarray(cv2.magnitude(x, y), np.float32)


def gradient_histogram(gradient: Float32Array) -> FloatArray:
    """Compute the histogram of the values of `sobel`.

    Returns
    -------
    (GRADIENT_BINS,) array
        Share of the values in each bin from 0 to `MAX_GRADIENT_DN`; larger ones are counted in the last bin.
    """
    counts, _ = np.histogram(np.minimum(gradient, MAX_GRADIENT_DN), GRADIENT_BINS, (0, MAX_GRADIENT_DN))
    return np.asarray(counts / gradient.size)


def edge_threshold(image: ByteArray) -> float:
    """Return twice the RMS of the blurred image's gradient [DN per pixel], the Sobel threshold of MATLAB's ``edge``."""
    return float(2 * np.sqrt(np.mean(np.square(_smooth_gradient(image), dtype=np.float64))))


def binary_edges(image: ByteArray, threshold: float) -> NDArray[np.bool_]:
    """Return (H, W) True where the blurred image's gradient exceeds a threshold [DN per pixel]."""
    return np.asarray(_smooth_gradient(image) > max(threshold, MIN_EDGE_DN))


def _smooth_gradient(image: ByteArray) -> Float32Array:
    return sobel(np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), EDGE_BLUR_PX), np.float32))


def image_statistics(image: ByteArray) -> ImageStatistics:
    """Return the statistics of an 8-bit image (H, W)."""
    gradient = sobel(image)
    black, bright = (float(v) for v in np.percentile(image, (1, 99)))
    p50, p95, p99 = (float(v) for v in np.percentile(gradient, (50, 95, 99)))
    border = max(round(BORDER_SHARE * image.shape[0]), 1)
    frame = np.ones(image.shape, bool)
    frame[border:-border, border:-border] = False
    return ImageStatistics(
        histogram=np.bincount(image.ravel(), minlength=256) / image.size,
        gradient_histogram=gradient_histogram(gradient),
        mean_dn=float(image.mean()),
        black_dn=black,
        bright_dn=bright,
        saturated=float(np.mean(image == 255)),
        noise_dn=noise_dn(image),
        gradient_p50=p50,
        gradient_p95=p95,
        gradient_p99=p99,
        edges=float(binary_edges(image, edge_threshold(image)).mean()),
        space=bool(np.mean(cv2.blur(image, (5, 5))[frame] < black + DARK_LEVEL_DN) >= SPACE_SHARE),
    )


def noise_dn(image: ByteArray) -> float:
    """Return the standard deviation of white noise [DN], from the mean magnitude of second differences.

    The median over square blocks is robust against edges and texture if half of the image is uniform. In
    front of black space a clipping sensor shows only the upper half of the noise.
    """
    second = np.abs(cv2.filter2D(image.astype(np.float64), -1, _NOISE_KERNEL))
    side = min(NOISE_BLOCK_PX, *image.shape)
    height, width = (n // side * side for n in image.shape)
    blocks_shape = (height // side, side, width // side, side)
    blocks = second[:height, :width].reshape(blocks_shape).mean(axis=(1, 3))
    clipped = (image[:height, :width] == 0).reshape(blocks_shape).mean(axis=(1, 3)) > CLIPPED_SHARE
    blocks[clipped] /= HALF_NOISE
    return float(np.sqrt(np.pi / 2) / 6 * np.median(blocks))


def histogram_distance_dn(a: FloatArray, b: FloatArray, largest: float) -> float:
    """Compute the earth mover's distance of two histograms over the same bins from 0 to ``largest`` [DN].

    Returns
    -------
    float
        Distance [DN], if both histograms are shares that sum to 1.
    """
    return float(np.abs(np.cumsum(a) - np.cumsum(b)).sum() * largest / len(a))
