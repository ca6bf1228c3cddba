"""Make the maps that are reduced from the packed maps of the Earth: land mask of the monthly maps, and albedo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_albedo import (
    AIR_ALBEDO,
    CLOUD_ALBEDO,
    MAP_SIZE,
    SEA_ALBEDO,
    mean_albedo,
)
from flyaround.simulator.celestial.seasons import HEIGHT, WIDTH
from flyaround.simulator.world.bodies.earth import EARTH

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array


def land_of_months(packed: ByteArray) -> ByteArray:
    """Return (1024, 2048): 255 on land, 0 elsewhere.

    Parameters
    ----------
    packed : ByteArray
        (H, W, 4) texture of one band from `packed_maps`.
    """
    coast = cv2.resize(packed[..., 3], (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.where(coast > 128 + 4, 255, 0).astype(np.uint8)


def make_albedo(packed: ByteArray, *, clouds: bool) -> Float32Array:
    """Return (2, 64, 128): albedo, and its derivative with respect to the albedo of the sea.

    Parameters
    ----------
    packed : ByteArray
        (H, W, 4) texture of one band from `packed_maps`.
    clouds : bool
        Whether the albedo includes the clouds.
    """
    # every fourth texel is enough for cells of 3 degrees
    part = np.asarray(packed[::4, ::4], np.float32) / 255
    land = part[..., 3] > 0.5
    ground = np.where(land, part[..., 0] ** 2, SEA_ALBEDO)
    clear = 1 - part[..., 1] ** 2 if clouds else np.ones_like(ground)
    albedo = AIR_ALBEDO + clear * ground + (1 - clear) * CLOUD_ALBEDO
    cells, sea = (
        np.asarray(cv2.resize(x, MAP_SIZE, interpolation=cv2.INTER_AREA), np.float32)
        for x in (albedo, clear * ~land)
    )
    scale = EARTH.albedo / mean_albedo(cells) if clouds else 1.0
    return np.asarray([cells * scale, sea * scale], np.float32)
