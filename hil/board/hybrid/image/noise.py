"""Noise of a picture, measured on the picture itself."""

from __future__ import annotations

from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.image_region import library_reads, region
from flyaround.hil.board.hybrid.native.library import is_available, library

Array = np.ndarray

# Immerkaer's mask.
IMMERKAER = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)

# Side of the tiles of a reduced picture that are compared [px], and the share of them that is flat in any picture.
FLAT_PX, FLATTEST = 16, 0.1

# What the mask leaves of the deviation of zero-mean normal noise that is cut off at zero.
HALVED = 0.58

# Zeros among three by three pixels that are dark, what the mask leaves there, and the least share of such pixels.
ZEROS, HALVED_AT_ZEROS, LEAST_DARK = 4, 0.512, 0.02

# Pixels well inside the scale that are enough to go by.
ENOUGH = 300

# Share of a reduced picture that is as dark as noise makes it, and how far below the middle that is [sigma].
DARKEST, NOISE_LEFT = 0.01, 2.0

# Share of a reduced picture that is a floor, and how far apart its darkest and brightest may be [sigma]; 1.05 by noise.
FLOOR, FLAT_SIGMA = 0.1, 3.0

# Values up to this are counted.
SMALL = 1 << 14


def noise_sigma(image: Array, full_scale: float) -> float:
    """Standard deviation of the noise where the scale does not clip it, in the picture's units.

    Immerkaer's mask (1996, Fast noise variance estimation) removes planes and edges' first order; the
    median absolute value ignores what texture remains. Black space clips half of the noise, so pixels
    well inside the scale decide where there are enough of them.
    """
    step = max(1, min(image.shape) // 400)
    if min(image.shape) < 3:
        return 0.0
    middle, inside, bright = _masked(image, step, full_scale)
    overall = middle / 6.0 * 1.4826
    if inside > ENOUGH:
        overall = max(overall, bright / 6.0 * 1.4826)
    elif overall > 0:
        overall /= HALVED
    return overall


def coarse_noise(reduced: Array, reduction: int) -> float:
    """Standard deviation of white noise that would leave in a reduced picture what its flattest tenth shows.

    Noise that a demosaicing, a lossy file or a filter has smoothed hides from a mask of three pixels, while means over
    many pixels carry all of it: pictures of a camera with 7 steps of it showed 1.7 to the mask, 8 to their means.

    Parameters
    ----------
    reduced : (h, w) float32 means over ``reduction`` x ``reduction`` pixels.
    """
    h, w = (n // FLAT_PX * FLAT_PX for n in (reduced.shape[0] - 2, reduced.shape[1] - 2))
    if min(h, w) < FLAT_PX:
        return 0.0
    mask = np.abs(cv2.filter2D(reduced, cv2.CV_32F, IMMERKAER)[1 : h + 1, 1 : w + 1])
    tiles = mask.reshape(h // FLAT_PX, FLAT_PX, w // FLAT_PX, FLAT_PX).transpose(0, 2, 1, 3)
    middles = np.median(tiles.reshape(-1, FLAT_PX * FLAT_PX), axis=1)
    return float(np.quantile(middles, FLATTEST)) / 6.0 * 1.4826 * reduction


def black_level(reduced: Array, noise: float) -> float:
    """What a camera with an offset adds to light: the level about which the darkest of a reduced picture lies.

    Parameters
    ----------
    noise : standard deviation of the reduced picture's.
    """
    return float(np.quantile(reduced, DARKEST)) + NOISE_LEFT * noise


def has_flat_floor(reduced: Array, noise: float) -> bool:
    """Whether the darkest tenth of a reduced picture differs by its noise alone: a floor, and no landscape's shade.

    Parameters
    ----------
    noise : standard deviation of the reduced picture's.
    """
    low, high = np.quantile(reduced, (DARKEST, FLOOR))
    return bool(high - low < FLAT_SIGMA * noise)


def _masked(image: Array, step: int, full_scale: float) -> Tuple[float, int, float]:
    """Median of the mask, how many of its pixels lie well inside the scale, and the median over them."""
    if image.dtype == np.uint8 and is_available() and library_reads(image):
        out = np.zeros(3)
        if library().fly_noise(*region(image), step, full_scale, out):
            raise MemoryError("no memory to measure noise")
        return float(out[0]), int(out[1]), float(out[2])
    # the same numbers
    rows = [image[y : y + 3] for y in range(0, image.shape[0] - 2, 3 * step)]
    a = _wider(np.stack(rows))
    absolute = _mask(a)
    total = a[:, 0] + a[:, 1] + a[:, 2]
    total = total[:, :-2] + total[:, 1:-1] + total[:, 2:]
    overall = whole_median(absolute)
    inside = total > 9 * (4 * (overall / 6.0 * 1.4826) + 0.02 * full_scale)
    inside &= total < 9 * 0.85 * full_scale
    number = int(np.count_nonzero(inside))
    return overall, number, whole_median(absolute[inside]) if number else 0.0


def clipped_noise(image: Array) -> float:
    """Standard deviation of the noise of darkness before it is cut off at zero; 0 where nothing is cut off.

    A camera with an offset shows all of its noise: nothing there is zero. Of zero-mean noise half is: what is left
    around such pixels tells how strong it was.
    """
    step = max(1, min(image.shape) // 100)
    rows = [image[y : y + 3] for y in range(0, image.shape[0] - 2, 3 * step)]
    if not rows or image.shape[1] < 3:
        return 0.0
    a = np.stack(rows)
    black = (a == 0).view(np.uint8)
    zeros = black[:, 0] + black[:, 1] + black[:, 2]
    dark = zeros[:, :-2] + zeros[:, 1:-1] + zeros[:, 2:] >= ZEROS
    if float(dark.mean()) < LEAST_DARK:
        return 0.0
    lap = _mask(_wider(a))[dark].astype(np.float32) / 6.0
    # the numbers are whole: the middle fifth of them has a mean that is not
    n = len(lap)
    middle = np.partition(lap, (2 * n // 5, 3 * n // 5))[2 * n // 5 : 3 * n // 5 + 1]
    return float(middle.mean()) * 1.4826 / HALVED_AT_ZEROS


def _wider(a: Array) -> Array:
    """Whole numbers with room for the mask: what it is divided by is left to the end."""
    return a.astype(np.int16 if a.dtype == np.uint8 else np.int32)


def _mask(a: Array) -> Array:
    """(K, W - 2) size of Immerkaer's mask over strips (K, 3, W): six standard deviations of what is noise."""
    col = a[:, 0] - 2 * a[:, 1] + a[:, 2]
    return np.abs(col[:, :-2] - 2 * col[:, 1:-1] + col[:, 2:])


def whole_median(values: Array) -> float:
    """Median of whole numbers from zero on: small ones are counted, which costs a fifth of sorting them."""
    if int(values.max()) > SMALL:
        return float(np.median(values))
    below = np.cumsum(np.bincount(values.ravel()))
    low, high = np.searchsorted(below, [(values.size - 1) // 2, values.size // 2], side="right")
    return 0.5 * float(low + high)
