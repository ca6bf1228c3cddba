"""Make the maps of ocean colour: reflectance of shallow and turbid water above the open ocean's.

They show banks, reefs, river plumes and silted lakes; a mask marks the cells with such water.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import COAST, PAN_WEIGHTS, day_map, decode_map
from flyaround.simulator.celestial.ocean_colour import HEIGHT, SCALE, WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, Float32Array

    Sources = tuple[ByteArray, ByteArray]

# exponent of the mapping of reflectance to 8 bits: nearly linear; the land's exponent compresses dark values
_POWER = 1.2
_DEEP = (2.0, 5.0, 20.0)  # open ocean in the day map: red, green, blue [counts]
_MIN_EXCESS = 2.5  # counts above the open ocean; lower excess is an artefact of the image's compression
_ICE = 60.0  # counts in every channel from which a texel counts as floating ice
_MIN_COAST_COUNTS = 24  # counts of the coast's distance (7 km): nearer texels are mixed with land
_SHORE_TEXELS = 7  # texels over which offshore values are extended to the shore
_MIN_REFLECTANCE = 0.01  # reflectance from which a cell of the mask contains such water


def make_ocean_colour(bands: int, mask: BoolArray, sources: Sources) -> ByteArray:
    """Return (2016, 4032) or (2016, 4032, 3): square root of the reflectance above the open ocean's over ``SCALE``.

    Parameters
    ----------
    bands : int
        Number of bands, 1 or 3.
    mask : BoolArray
        (360, 720) mask of `make_mask`.
    sources : Sources
        Maps of `day_and_coast`.
    """
    # cells outside the mask are not rendered, so the map is zero there
    core = cv2.erode(mask.astype(np.float32), np.ones((3, 3)))
    share = cv2.resize(core, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    day, coast = sources
    over = _reflectance(_excess_over_open_ocean(day, coast)) * share[..., None]
    return _bytes(np.sqrt(over @ np.array(PAN_WEIGHTS, np.float32) if bands == 1 else over))


def day_and_coast() -> Sources:
    """Return (2016, 4032, 3) red, green, blue and (2016, 4032) distance to the coast, from the day and coast maps."""
    return day_map((WIDTH, HEIGHT))[..., ::-1], decode_map(COAST, cv2.IMREAD_GRAYSCALE, (WIDTH, HEIGHT))


def _excess_over_open_ocean(day: ByteArray, coast: ByteArray) -> Float32Array:
    """Return (2016, 4032, 3) the map's 8 bits minus the open ocean's, scaled to 0..1."""
    bright = day.astype(np.float32)
    over = np.clip(bright - (np.array(_DEEP, np.float32) + np.float32(_MIN_EXCESS)), 0, None)
    over *= np.float32(1 / (255 - _MIN_EXCESS))
    red, green, blue = cv2.split(bright)
    sea = ((coast < 128 - _MIN_COAST_COUNTS) & (cv2.min(cv2.min(red, green), blue) < _ICE)).astype(np.float32)
    # at the shore and under ice, use the water farther out
    weight = cv2.blur(sea, (_SHORE_TEXELS, _SHORE_TEXELS))
    carried = cv2.blur(over * sea[..., None], (_SHORE_TEXELS, _SHORE_TEXELS))
    carried *= ((weight > 0) / np.maximum(weight, 1e-3))[..., None].astype(np.float32)
    return np.where(sea[..., None] > 0, over, carried)


def _reflectance(over: Float32Array) -> Float32Array:
    """Return the reflectance above the open ocean's divided by ``SCALE``, from `_excess_over_open_ocean`."""
    return np.asarray(cv2.pow(over, _POWER), np.float32)


def _bytes(values: NDArray[np.float32]) -> ByteArray:
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)


def make_mask(sources: Sources) -> ByteArray:
    """Return (360, 720): 255 within half a degree of water that is noticeably brighter than the open ocean."""
    day, coast = sources
    over = _excess_over_open_ocean(day, coast)
    bright = SCALE * _reflectance(over).max(axis=2) > _MIN_REFLECTANCE
    # rows and columns are not multiples of whole texels: each half degree uses every texel that it touches
    is_bright = np.zeros((360, 720), np.uint8)
    row, column = np.nonzero(bright & (coast < 128 - _MIN_COAST_COUNTS))
    is_bright[row * 360 // HEIGHT, column * 720 // WIDTH] = 255
    wrapped = np.pad(is_bright, ((1, 1), (1, 1)), mode="wrap")
    return np.asarray(cv2.dilate(wrapped, np.ones((3, 3), np.uint8))[1:-1, 1:-1], np.uint8)
