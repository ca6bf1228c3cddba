"""Preparation of an image: noise, weak gradients, regions, background and black level."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from flyaround.hil.board.hybrid.image.edge_field import shrink
from flyaround.hil.board.hybrid.image.noise import (
    black_level,
    coarse_noise,
    has_flat_floor,
    integer_median,
    noise_sigma,
)
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.propose.regions import REDUCTION, propose_regions
from flyaround.hil.board.hybrid.search_states import PreparedImage, SearchSetup
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients

Array = np.ndarray

# Full scale of an 8-bit image, and minimum noise on this scale: half of the quantisation noise of 1 / sqrt(12).
FULL_SCALE, MIN_NOISE = 255.0, 0.15

# Ratio of the noise measured on means over many pixels to that of single pixels above which the noise was smoothed by
# a filter or by compression; hand-tuned, as are the values below.
SMOOTHED_RATIO = 1.4

# Minimum black level in front of a texture [sigma of the noise], because its dark parts lie above zero as well.
MIN_BLACK_SIGMA = 3.0

# Share of tiles with edges above which the background is not empty space.
MAX_BUSY_SHARE = 0.25

# Minimum diagonal of a region [px].
MIN_DIAGONAL_PX = 24.0


def prepare(setup: SearchSetup, frame: Observation) -> PreparedImage:
    """Measure an image's noise and black level, and propose the regions that may contain the target.

    Returns
    -------
    PreparedImage
        ``frame``, in which noise, black level, background and craft probability are now set, with the reduced image and
        the regions, most likely first. Regions with a diagonal below `MIN_DIAGONAL_PX` are omitted; there may be none.
    """
    reduced, smoothed = _measure_noise(frame)
    frame.mark("noise")
    # Sharma, Ventura & D'Amico (2018)
    edges = eliminate_weak_gradients(reduced)
    frame.keep("wge", edges)
    frame.mark("weak_gradients")
    regions, busy, frame.craft_probability = propose_regions(reduced, edges, frame.noise / REDUCTION)
    if busy < MAX_BUSY_SHARE:
        # reduced pixels are rounded to integers
        frame.background = integer_median(reduced.astype(np.int32))
    frame.black = _black_level(frame, reduced, busy, smoothed=smoothed)
    frame.count("regions", len(regions))
    frame.keep("regions", regions)
    frame.mark("regions")
    return PreparedImage(
        setup,
        frame,
        reduced,
        [r for r in regions if r.diagonal_px >= MIN_DIAGONAL_PX],
    )


def _measure_noise(frame: Observation) -> Tuple[Array, bool]:
    """Set the noise of the image (Immerkaer 1996). Return the reduced image, and True if the noise was smoothed."""
    image = frame.image
    # a 16-bit file may hold 10 or 12 bits: its largest value is taken as full scale
    full_scale = FULL_SCALE if image.dtype == np.uint8 else float(image.max())
    frame.noise = max(noise_sigma(image, full_scale), MIN_NOISE * full_scale / FULL_SCALE)
    reduced, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
    coarse = coarse_noise(reduced, REDUCTION)
    if coarse <= SMOOTHED_RATIO * frame.noise:
        return reduced, False
    frame.noise = coarse
    return reduced, True


def _black_level(frame: Observation, reduced: Array, busy: float, *, smoothed: bool) -> float:
    """Return the black level; 0 if the image has none."""
    noise = frame.noise / REDUCTION
    if not smoothed and frame.clipped:
        # the noise is clipped at zero, so the camera adds no offset
        return 0.0
    black = black_level(reduced, noise)
    if smoothed or busy < MAX_BUSY_SHARE:
        return black
    # an image filled by the Earth also has a darkest part
    return black if has_flat_floor(reduced, noise) and black > MIN_BLACK_SIGMA * frame.noise else 0.0
