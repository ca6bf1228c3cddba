"""Noise and black level of an image, measured on the image itself."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.image_region import library_reads, region
from flyaround.hil.board.hybrid.native.library import is_available, library

Array = np.ndarray

# Mask of Immerkaer (1996), Fast noise variance estimation.
IMMERKAER = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)

# Euclidean norm of that mask, and standard deviation of normal noise over its median absolute value.
MASK_NORM, MAD_TO_SIGMA = 6.0, 1.4826

# Side of the tiles of a reduced image [px], and the share of them assumed flat in any image.
TILE_PX, FLAT_SHARE = 16, 0.1

# Mask response to zero-mean normal noise clipped at zero, as a share of that to unclipped noise.
CLIPPED_RESPONSE = 0.58

# Zeros in a 3 x 3 neighbourhood from which it counts as dark; mask response there; minimum share of dark pixels.
MIN_ZEROS, DARK_RESPONSE, MIN_DARK_SHARE = 4, 0.512, 0.02

# Minimum number of pixels well inside the scale, and the means of nine pixels that are: distance above black [sigma
# and share of full scale], and largest share of full scale. The native library has the same; hand-tuned.
MIN_UNCLIPPED_PIXELS = 300
UNCLIPPED_SIGMA, UNCLIPPED_SHARES = 4, (0.02, 0.85)

# Quantile that bounds the darkest part of a reduced image, and its distance below that part's mean [sigma].
DARK_QUANTILE, DARK_OFFSET_SIGMA = 0.01, 2.0

# Quantile that bounds the floor of a reduced image, and largest spread of the floor [sigma]; noise alone gives 1.05.
FLOOR_QUANTILE, MAX_FLOOR_SPREAD_SIGMA = 0.1, 3.0

# Largest value for which the median is computed by counting.
MAX_COUNTED_VALUE = 1 << 14


def noise_sigma(image: Array, full_scale: float) -> float:
    """Estimate the standard deviation of the noise where the scale does not clip it.

    Immerkaer's mask (1996, Fast noise variance estimation) suppresses planes and edges to first order, and the median
    absolute response ignores the remaining texture. Black space clips half of the noise, so pixels well inside the
    scale are preferred if there are enough of them.

    Returns
    -------
    float
        Standard deviation [pixel values]; 0 for an image with a side of less than 3 pixels.
    """
    step = max(1, min(image.shape) // 400)
    if min(image.shape) < 3:
        return 0.0
    middle, inside, bright = _mask_medians(image, step, full_scale)
    overall = middle / MASK_NORM * MAD_TO_SIGMA
    if inside > MIN_UNCLIPPED_PIXELS:
        overall = max(overall, bright / MASK_NORM * MAD_TO_SIGMA)
    elif overall > 0:
        overall /= CLIPPED_RESPONSE
    return overall


def coarse_noise(reduced: Array, reduction: int) -> float:
    """Return the standard deviation of white noise that explains the flattest tenth of a reduced image.

    A 3 x 3 mask underestimates noise smoothed by demosaicing, lossy compression or filtering; means over many pixels
    preserve it.

    Parameters
    ----------
    reduced : (h, w) array
        Means over ``reduction`` x ``reduction`` pixels, float32.
    reduction : int
        Side of the averaged squares [px].
    """
    h, w = (n // TILE_PX * TILE_PX for n in (reduced.shape[0] - 2, reduced.shape[1] - 2))
    if min(h, w) < TILE_PX:
        return 0.0
    mask = np.abs(cv2.filter2D(reduced, cv2.CV_32F, IMMERKAER)[1 : h + 1, 1 : w + 1])
    tiles = mask.reshape(h // TILE_PX, TILE_PX, w // TILE_PX, TILE_PX).transpose(0, 2, 1, 3)
    middles = np.median(tiles.reshape(-1, TILE_PX * TILE_PX), axis=1)
    return float(np.quantile(middles, FLAT_SHARE)) / MASK_NORM * MAD_TO_SIGMA * reduction


def black_level(reduced: Array, noise: float) -> float:
    """Return the black level of a camera with an offset: the mean of the darkest part of a reduced image.

    Parameters
    ----------
    reduced : (h, w) array
        Reduced image.
    noise : float
        Standard deviation of its noise.
    """
    return float(np.quantile(reduced, DARK_QUANTILE)) + DARK_OFFSET_SIGMA * noise


def has_flat_floor(reduced: Array, noise: float) -> bool:
    """Return True if the darkest tenth of a reduced image varies by noise only, unlike a shaded landscape.

    Parameters
    ----------
    reduced : (h, w) array
        Reduced image.
    noise : float
        Standard deviation of its noise.
    """
    low, high = np.quantile(reduced, (DARK_QUANTILE, FLOOR_QUANTILE))
    return bool(high - low < MAX_FLOOR_SPREAD_SIGMA * noise)


def _mask_medians(image: Array, step: int, full_scale: float) -> Tuple[float, int, float]:
    """Return the median mask response, the number of pixels well inside the scale, and the median over those."""
    if image.dtype == np.uint8 and is_available() and library_reads(image):
        out = np.zeros(3)
        if library().fly_noise(*region(image), step, full_scale, out):
            raise MemoryError("out of memory while measuring noise")
        return float(out[0]), int(out[1]), float(out[2])
    # same result without the native library
    rows = [image[y : y + 3] for y in range(0, image.shape[0] - 2, 3 * step)]
    a = _widen(np.stack(rows))
    absolute = _mask_response(a)
    total = a[:, 0] + a[:, 1] + a[:, 2]
    total = total[:, :-2] + total[:, 1:-1] + total[:, 2:]
    overall = integer_median(absolute)
    low, high = UNCLIPPED_SHARES
    inside = total > 9 * (UNCLIPPED_SIGMA * (overall / MASK_NORM * MAD_TO_SIGMA) + low * full_scale)
    inside &= total < 9 * high * full_scale
    number = int(np.count_nonzero(inside))
    return overall, number, integer_median(absolute[inside]) if number else 0.0


def clipped_noise(image: Array) -> float:
    """Return the standard deviation of dark pixels' noise before clipping at zero; 0 if nothing is clipped.

    A camera with an offset has no zeros. Zero-mean noise is half clipped; the pixels around zeros show its strength.
    """
    step = max(1, min(image.shape) // 100)
    rows = [image[y : y + 3] for y in range(0, image.shape[0] - 2, 3 * step)]
    if not rows or image.shape[1] < 3:
        return 0.0
    a = np.stack(rows)
    black = (a == 0).view(np.uint8)
    zeros = black[:, 0] + black[:, 1] + black[:, 2]
    dark = zeros[:, :-2] + zeros[:, 1:-1] + zeros[:, 2:] >= MIN_ZEROS
    if float(dark.mean()) < MIN_DARK_SHARE:
        return 0.0
    lap = _mask_response(_widen(a))[dark].astype(np.float32) / 6.0
    # for integers, the mean of the middle fifth is finer than the median
    n = len(lap)
    middle = np.partition(lap, (2 * n // 5, 3 * n // 5))[2 * n // 5 : 3 * n // 5 + 1]
    return float(middle.mean()) * MAD_TO_SIGMA / DARK_RESPONSE


def _widen(a: Array) -> Array:
    """Return integers wide enough for the mask; its division is postponed."""
    return a.astype(np.int16 if a.dtype == np.uint8 else np.int32)


def _mask_response(a: Array) -> Array:
    """Return the absolute mask response (K, W - 2) over strips (K, 3, W); white noise gives six sigma rms."""
    col = a[:, 0] - 2 * a[:, 1] + a[:, 2]
    return np.abs(col[:, :-2] - 2 * col[:, 1:-1] + col[:, 2:])


def integer_median(values: Array) -> float:
    """Return the median of non-negative integers; small ones are counted, which is faster than sorting."""
    if int(values.max()) > MAX_COUNTED_VALUE:
        return float(np.median(values))
    below = np.cumsum(np.bincount(values.ravel()))
    low, high = np.searchsorted(below, [(values.size - 1) // 2, values.size // 2], side="right")
    return 0.5 * float(low + high)
