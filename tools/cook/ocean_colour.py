"""Cook the maps of ocean colour: reflectance of shallow and turbid water above the open ocean's, from the day map.

Banks, reefs, rivers' plumes, lakes full of silt; and a mask of where they are.
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

_POWER = 1.2  # power of the map's 8 bits: nearly linear, where the land's darker values are compressed
_DEEP = (2.0, 5.0, 20.0)  # colour of the open ocean in the map: red, green, blue
_NOTHING = 2.5  # counts over it that are only the picture's compression
_ICE = 60.0  # counts in every channel: floating ice, not water
_OFFSHORE = 24  # counts of the coast's distance (7 km): nearer texels are mixtures with land
_ASHORE = 7  # texels over which offshore values are extended to the shore
_NOTICED = 0.01  # reflectance for which a cell of the screen looks


def make_ocean_colour(bands: int, mask: BoolArray, sources: Sources) -> ByteArray:
    """Return (2016, 4032) or (2016, 4032, 3) square roots of the reflectance over the open ocean's, over ``SCALE``.

    Parameters
    ----------
    mask : (360, 720) of `make_mask`.
    sources : `day_and_coast`.
    """
    # nothing is left where no cell looks
    core = cv2.erode(mask.astype(np.float32), np.ones((3, 3)))
    share = cv2.resize(core, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    day, coast = sources
    over = _reflectance(_excess_over_open_ocean(day, coast)) * share[..., None]
    return _bytes(np.sqrt(over @ np.array(PAN_WEIGHTS, np.float32) if bands == 1 else over))


def day_and_coast() -> Sources:
    """Return (2016, 4032, 3) red, green, blue and (2016, 4032) distance to the coast, of the maps."""
    return day_map((WIDTH, HEIGHT))[..., ::-1], decode_map(COAST, cv2.IMREAD_GRAYSCALE, (WIDTH, HEIGHT))


def _excess_over_open_ocean(day: ByteArray, coast: ByteArray) -> Float32Array:
    """Return (2016, 4032, 3) of the map's 8 bits over the open ocean's, 0..1."""
    bright = day.astype(np.float32)
    over = np.clip(bright - (np.array(_DEEP, np.float32) + np.float32(_NOTHING)), 0, None)
    over *= np.float32(1 / (255 - _NOTHING))
    red, green, blue = cv2.split(bright)
    sea = ((coast < 128 - _OFFSHORE) & (cv2.min(cv2.min(red, green), blue) < _ICE)).astype(np.float32)
    # at the shore, and under ice, use the water further out
    known = cv2.blur(sea, (_ASHORE, _ASHORE))
    carried = cv2.blur(over * sea[..., None], (_ASHORE, _ASHORE))
    carried *= ((known > 0) / np.maximum(known, 1e-3))[..., None].astype(np.float32)
    return np.where(sea[..., None] > 0, over, carried)


def _reflectance(over: Float32Array) -> Float32Array:
    """Return the reflectance over the open ocean's, divided by ``SCALE``, from `_excess_over_open_ocean`."""
    return np.asarray(cv2.pow(over, _POWER), np.float32)


def _bytes(values: NDArray[np.float32]) -> ByteArray:
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)


def make_mask(sources: Sources) -> ByteArray:
    """Return (360, 720), 255 where the water is noticeably brighter than the open ocean, and half a degree around
    it.
    """
    day, coast = sources
    over = _excess_over_open_ocean(day, coast)
    bright = SCALE * _reflectance(over).max(axis=2) > _NOTICED
    # rows and columns do not divide by whole texels: each half degree takes what touches it
    found = np.zeros((360, 720), np.uint8)
    row, column = np.nonzero(bright & (coast < 128 - _OFFSHORE))
    found[row * 360 // HEIGHT, column * 720 // WIDTH] = 255
    wrapped = np.pad(found, ((1, 1), (1, 1)), mode="wrap")
    return np.asarray(cv2.dilate(wrapped, np.ones((3, 3), np.uint8))[1:-1, 1:-1], np.uint8)
