"""Fixed-pattern noise: photo-response (PRNU), offset (DSNU) and dark-current non-uniformity of one detector."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.deviates import bit_source

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.sensor import Detector
    from flyaround.simulator.runtime.arrays import Float32Array

_KEY = 0x466C79  # keeps the pattern's random numbers apart from any frame's


@dataclass(frozen=True, eq=False)
class FixedPattern:
    """Maps over the image's pixels; `None` for a term that is zero.

    Parameters
    ----------
    sensitivity : (H, W) factor, mean one; zero where a pixel is dead.
    offset_e : (H, W) [e]. dark_e_s : (H, W) dark current of each pixel [e s-1].
    """

    sensitivity: Float32Array | None
    offset_e: Float32Array | None
    dark_e_s: Float32Array | None


def fixed_pattern(detector: Detector, height: int, width: int) -> FixedPattern:
    """The fixed pattern of a detector, at the image's pixels.

    Each physical row has random numbers of its own, so that a region of interest sees the pixels that the whole
    image would.
    """
    # the frame's own terms have no part in the pattern: one table serves whatever they are
    return _pattern(
        replace(detector, gain_e_per_dn=1.0, black_level_dn=0.0, read_noise_e=0.0, full_well_e=1.0),
        height,
        width,
    )


@lru_cache(maxsize=4)
def _pattern(d: Detector, height: int, width: int) -> FixedPattern:
    b = d.binning
    rows, columns = height * b, width * b
    has_gain = d.prnu > 0 or d.dead_pixel_share > 0
    has_dark = d.dark_e_s > 0 or (d.hot_pixel_share > 0 and d.hot_pixel_e_s > 0)
    sensitivity = np.ones((rows, columns), np.float32) if has_gain else None
    offset = np.zeros((rows, columns), np.float32) if d.dsnu_e > 0 else None
    dark = np.full((rows, columns), d.dark_e_s, np.float32) if has_dark else None
    warming = d.dark_e_s / d.dark_current_e_s if d.dark_current_e_s > 0 else 1.0
    last = d.roi_x0_px + columns
    for row in range(rows):
        rng = np.random.Generator(bit_source(d.serial, _KEY, d.roi_y0_px + row))
        gain_n, offset_n, dark_n = (
            rng.standard_normal(last + 1, np.float32)[d.roi_x0_px : last] for _ in range(3)
        )
        hot, dead = (rng.random(last + 1)[d.roi_x0_px : last] for _ in range(2))
        heat = rng.standard_exponential(last + 1)[d.roi_x0_px : last]
        if sensitivity is not None:
            sensitivity[row] = np.where(dead < d.dead_pixel_share, 0, np.maximum(1 + d.prnu * gain_n, 0))
        if offset is not None:
            offset[row] = d.dsnu_e * offset_n
        if dark is not None:
            dark[row] *= np.maximum(1 + d.dark_nonuniformity * dark_n, 0)
            dark[row] += np.where(hot < d.hot_pixel_share, heat * d.hot_pixel_e_s * warming, 0)
    return FixedPattern(
        None if sensitivity is None else _binned(sensitivity, b) / np.float32(b * b),
        None if offset is None else _binned(offset, b),
        None if dark is None else _binned(dark, b),
    )


def _binned(values: Float32Array, b: int) -> Float32Array:
    height, width = values.shape[0] // b, values.shape[1] // b
    return np.asarray(values.reshape(height, b, width, b).sum(axis=(1, 3), dtype=np.float32))
