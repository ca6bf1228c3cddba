"""Ocean colour: reflectance of shallow and turbid water above that of the open ocean, and where there is such water.

`python -m tools.cook` makes the maps from the day map. A tile of the screen that the mask keeps away from such water
does not look them up.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import decode_map

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray

WIDTH, HEIGHT = 4032, 2016
MASK = "ocean_colour_mask_720x360.png"
MAPS = {1: "ocean_colour_mono_4032x2016.png", 3: "ocean_colour_4032x2016.png"}
"""Files by the number of bands."""
SCALE = 0.35  # reflectance of a map's texel that is as blue as can be: clear shallows over white sand (Maritorena 1994)


def ocean_colour(bands: int) -> ByteArray:
    """Return (2016, 4032) or (2016, 4032, 4): square root of the reflectance over the open ocean's, over ``SCALE``."""
    image = decode_map(MAPS[bands], cv2.IMREAD_UNCHANGED, None)
    return image if bands == 1 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGBA), np.uint8)


@lru_cache(maxsize=1)
def _mask() -> BoolArray:
    return decode_map(MASK, cv2.IMREAD_GRAYSCALE, None) > 0


def near_bright_water(z: FloatArray, longitude: FloatArray) -> BoolArray:
    """Return whether there is shallow or turbid water within half a degree or a degree.

    Parameters
    ----------
    z : sine of the latitude. longitude : [rad]; of the same shape as z. NaN gives False.
    """
    known = np.isfinite(z) & np.isfinite(longitude)
    row = np.clip(180 - 2 * np.degrees(np.arcsin(np.clip(np.where(known, z, 0), -1, 1))), 0, 359).astype(int)
    column = (2 * np.degrees(np.where(known, longitude, 0)) + 360).astype(int) % 720
    return np.asarray(_mask()[row, column] & known)
