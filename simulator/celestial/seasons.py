"""Maps of the land that the Earth's vertex shader samples: monthly reflectance over August's, and terrain slopes.

Both vary little within a screen tile, so they are sampled at its corners, not at its pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import (
    PAN_WEIGHTS,
    asset_size,
    decode_map,
    fill_sea,
    maps_entry,
    to_reflectance,
)
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array, cached_arrays
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.time.instant import datetime_utc

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

# Size of the monthly maps [px].
WIDTH, HEIGHT = 2048, 1024
LAND = "land_2048x1024.png"

# Height map, and metres per count of it.
HEIGHT_MAP, HEIGHT_M_PER_COUNT = "height_4032x2016.png", 24.8
OCTAVES = 4.0
"""Full scale of a gain's channels: log2 of the ratio is -4 to 4."""
SLOPE_MAX = 0.25
"""Full scale of the slope channels: -0.25 to 0.25."""
ROUGH_M = 400.0
"""Full scale of roughness: standard deviation of the height over 30 km [m]."""
_MAP_MONTH = 8  # month of the fine map
ANCHORS: dict[int, float] = {1: 15.0, 3: 74.0, 5: 135.0, 7: 196.0, 8: 227.0, 10: 288.0}
"""Day of the year in the middle of each month that has a map."""
_STRIP_ROWS = 16  # rows computed together; with their neighbours they fit a processor's cache
_YEAR_DAYS = 365.25  # a Julian year
_MIN_REFLECTANCE = 0.004  # added to both reflectances, because a ratio of smaller ones is only noise


@dataclass(frozen=True)
class Season:
    """Two months between which the maps are interpolated.

    Parameters
    ----------
    before : int
        Month of the earlier map, 1 to 12.
    after : int
        Month of the later map.
    share : float
        Weight of the later map, 0..1.
    """

    before: int
    after: int
    share: float


def season(epoch_utc: str) -> Season:
    """Return the monthly maps before and after a date (ISO 8601).

    Returns
    -------
    Season
        Months of `ANCHORS` before and after the date, across the turn of the year too, and the weight of the later one.
    """
    time = datetime_utc(epoch_utc)
    day = time.timetuple().tm_yday + (time.hour + time.minute / 60) / 24
    months, days = list(ANCHORS), list(ANCHORS.values())
    k = int(np.searchsorted(days, day, side="right")) - 1  # -1: before the middle of January
    start, end = days[k], days[(k + 1) % len(days)]
    span = (end - start) % _YEAR_DAYS
    return Season(months[k], months[(k + 1) % len(months)], float(((day - start) % _YEAR_DAYS) / span))


def month_gain(month: int, bands: int) -> ByteArray:
    """Return the gain of a month over August: log2 of the ratio of reflectances; it is cached.

    Parameters
    ----------
    month : int
        A month of `ANCHORS`.
    bands : int
        1 for the panchromatic band, 3 for red, green and blue.

    Returns
    -------
    (1024, 2048) or (1024, 2048, 4) array
        8-bit values; 128 is a ratio of 1, and `OCTAVES` is full scale.
    """
    return month_gains((month,), bands)[0]


def month_gains(months: Sequence[int], bands: int) -> list[ByteArray]:
    """Return the gains of several months over August, whose maps are decoded only once for all.

    Returns
    -------
    list of array
        Gains as from `month_gain`, in the order of ``months``.
    """
    return cached_arrays([_key(month, bands) for month in months], lambda: _make_gains(months, bands))


def _key(month: int, bands: int) -> str:
    names = [_name(month), _name(_MAP_MONTH)]
    return entry_name(
        f"season-{month:02d}", (_make_gains,), bands, [asset_size(n) for n in names], maps_entry()
    )


def _name(month: int) -> str:
    return f"day_month-{month:02d}_2048x1024.jpg"


def _make_gains(months: Sequence[int], bands: int) -> list[ByteArray]:
    unit_gain = np.full((HEIGHT, WIDTH) if bands == 1 else (HEIGHT, WIDTH, 4), 128, np.uint8)
    if bands != 1:
        unit_gain[..., 3] = 255
    other_months = [month for month in months if month != _MAP_MONTH]
    gains = {_MAP_MONTH: unit_gain}
    if other_months:
        land = (decode_map(LAND, cv2.IMREAD_GRAYSCALE, None) > 0).astype(np.uint8)
        august = _reflectances(_MAP_MONTH, bands)
        gains |= {month: _gain(_reflectances(month, bands), august, land) for month in other_months}
    return [gains[month] for month in months]


def _reflectances(month: int, bands: int) -> list[FloatArray]:
    """Return a month's maps (H, W): one of the whole band, or red, green and blue."""
    image = decode_map(_name(month), cv2.IMREAD_COLOR, (WIDTH, HEIGHT))
    channels = [cv2.LUT(channel, to_reflectance()) for channel in cv2.split(image)[::-1]]
    if bands == 1:
        return [np.asarray(sum(w * channel for w, channel in zip(PAN_WEIGHTS, channels, strict=True)))]
    return [np.asarray(channel) for channel in channels]


def _gain(month: list[FloatArray], august: list[FloatArray], land: ByteArray) -> ByteArray:
    pairs = zip(month, august, strict=True)
    logs = [
        np.log2((reflectance + _MIN_REFLECTANCE) / (august_reflectance + _MIN_REFLECTANCE)).astype(np.float32)
        for reflectance, august_reflectance in pairs
    ]
    filled = [fill_sea(log, land) for log in logs]
    encoded = [np.clip(128 + 127 / OCTAVES * log + 0.5, 0, 255).astype(np.uint8) for log in filled]
    if len(encoded) == 1:
        return np.ascontiguousarray(encoded[0])
    return np.ascontiguousarray(np.dstack([*encoded, np.full(land.shape, 255, np.uint8)]))


def ground_slopes() -> ByteArray:
    """Return the terrain's slopes and roughness; they are cached.

    Returns
    -------
    (2016, 4032, 4) array
        8-bit slope to the east, slope to the north (scaled by `SLOPE_MAX`), roughness (`ROUGH_M`), and 255.
    """
    key = entry_name("terrain-slopes", (_make_ground_slopes, decode_map), asset_size(HEIGHT_MAP))
    return cached_array(key, _make_ground_slopes)


def _make_ground_slopes() -> ByteArray:
    counts = decode_map(HEIGHT_MAP, cv2.IMREAD_GRAYSCALE, None)
    rows, columns = counts.shape
    texel_m = np.pi * EARTH_RADIUS_M / rows
    latitude = np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi
    slopes = np.empty((rows, columns, 4), np.uint8)
    # a strip with its neighbouring rows fits a processor's cache
    for first in range(0, rows, _STRIP_ROWS):
        strip = slice(first, min(first + _STRIP_ROWS, rows))
        with_neighbours = slice(max(strip.start - 1, 0), min(strip.stop + 1, rows))
        strip_rows = slice(strip.start - with_neighbours.start, strip.stop - with_neighbours.start)
        height = counts[with_neighbours].astype(np.float32) * HEIGHT_M_PER_COUNT
        slopes[strip] = _encode_slopes(height, texel_m, latitude[with_neighbours])[strip_rows]
    return slopes


def _encode_slopes(height: Float32Array, texel_m: float, latitude: FloatArray) -> ByteArray:
    """Return the values (R, W, 4) of `ground_slopes` for rows of heights (R, W) [m] at latitudes (R,) [rad]."""
    # the image's border at the date line is replicated, which spoils one texel
    kernel = np.array([[-0.5, 0.0, 0.5]], np.float32)
    east = cv2.filter2D(height, -1, kernel) / (texel_m * np.cos(latitude)[:, None].clip(0.05)).astype(
        np.float32
    )
    north = cv2.filter2D(height, -1, -kernel.T / np.float32(texel_m))
    mean = cv2.blur(height, (3, 3))
    variance = cv2.blur(height * height, (3, 3)) - mean * mean
    rough = cv2.sqrt(np.clip(variance, 0, None)) * np.float32(255 / ROUGH_M)
    slopes = [
        cv2.convertScaleAbs(np.clip(s * (255 / (2 * SLOPE_MAX)) + 127.5, 0, 255)) for s in (east, north)
    ]
    full = np.full(height.shape, 255, np.uint8)
    return np.asarray(cv2.merge([*slopes, cv2.convertScaleAbs(rough), full]), np.uint8)
