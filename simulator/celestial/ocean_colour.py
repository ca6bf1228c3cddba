"""Ocean colour: reflectance of shallow and turbid water relative to the open ocean, and a mask of such water.

`python -m tools.cook` makes the maps from the day map. Screen tiles that the mask excludes skip the look-up.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import decode_map

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray

# Size of the map [px].
WIDTH, HEIGHT = 4032, 2016
MASK = "ocean_colour_mask_720x360.png"

MAPS = {1: "ocean_colour_mono_4032x2016.png", 3: "ocean_colour_4032x2016.png"}
"""Files, by number of bands."""

SCALE = 0.35  # reflectance of the bluest texel: clear shallows over white sand (Maritorena 1994)


def ocean_colour(bands: int) -> ByteArray:
    """Return the map of the ocean's colour.

    Returns
    -------
    (2016, 4032) or (2016, 4032, 4) array
        8-bit square root of the reflectance above the open ocean's, over ``SCALE``: of one band, or of red, green and
        blue with an alpha channel that is unused.
    """
    image = decode_map(MAPS[bands], cv2.IMREAD_UNCHANGED, None)
    return image if bands == 1 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGBA), np.uint8)


@lru_cache(maxsize=1)
def _mask() -> BoolArray:
    return decode_map(MASK, cv2.IMREAD_GRAYSCALE, None) > 0


def near_bright_water(z: FloatArray, longitude: FloatArray) -> BoolArray:
    """Return True where shallow or turbid water lies within half a degree to a degree.

    Parameters
    ----------
    z : array
        Sine of the latitude.
    longitude : array
        [rad], of the same shape. NaN gives False.

    Returns
    -------
    array of bool
        Mask of the input's shape.
    """
    finite = np.isfinite(z) & np.isfinite(longitude)
    row = np.clip(180 - 2 * np.degrees(np.arcsin(np.clip(np.where(finite, z, 0), -1, 1))), 0, 359).astype(int)
    column = (2 * np.degrees(np.where(finite, longitude, 0)) + 360).astype(int) % 720
    return np.asarray(_mask()[row, column] & finite)
