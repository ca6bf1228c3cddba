"""The land through the year: how much brighter or darker than in August, and the relief that the map is too coarse for.

Both change little within a cell of the screen: the vertices read them, the pixels do not.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.render.cache import cached_array
from simulator.render.maps import PAN_WEIGHTS, asset_size, decode_map, land_only, packed_maps, to_reflectance

if TYPE_CHECKING:
    from simulator.arrays import ByteArray

WIDTH, HEIGHT = 2048, 1024
HEIGHT_MAP, HEIGHT_M_PER_COUNT = "height_4032x2016.png", 24.8
OCTAVES = 4.0  # the gain's channels hold plus and minus this many octaves
SLOPE_MAX = 0.25  # the relief's channels hold plus and minus this
ROUGH_M = 400.0  # standard deviation of the height over 30 km where the land is as rough as can be
_MAP_MONTH = 8  # of the fine map
_VERSION = 3
# middle of each month there is a map of [day of the year]
ANCHORS: dict[int, float] = {1: 15.0, 3: 74.0, 5: 135.0, 7: 196.0, 8: 227.0, 10: 288.0}
_YEAR = 365.25
_EPSILON = 0.004  # reflectance below which a ratio means nothing


@dataclass(frozen=True)
class Season:
    """The two months to mix, and the share of the second."""

    before: int
    after: int
    share: float


def season(epoch_utc: str) -> Season:
    """Which monthly maps a date lies between."""
    moment = datetime.fromisoformat(epoch_utc)
    day = moment.timetuple().tm_yday + (moment.hour + moment.minute / 60) / 24
    months, days = list(ANCHORS), list(ANCHORS.values())
    k = int(np.searchsorted(days, day, side="right")) - 1  # -1: before the middle of January
    start, end = days[k], days[(k + 1) % len(days)]
    span = (end - start) % _YEAR
    return Season(months[k], months[(k + 1) % len(months)], float(((day - start) % _YEAR) / span))


def month_gain(month: int, bands: int) -> ByteArray:
    """(1024, 2048) or (1024, 2048, 4): log2 of a month's reflectance over August's, ``OCTAVES`` either side of 128."""
    names = [_name(month), _name(_MAP_MONTH)]
    key = hashlib.sha256(
        f"{_VERSION} {bands} {[asset_size(n) for n in names]} {to_reflectance()[[0, 100]]}".encode()
    ).hexdigest()[:16]
    return cached_array(f"season-{month:02d}-{key}", lambda: _make_gain(month, bands))


def _name(month: int) -> str:
    return f"day_month-{month:02d}_2048x1024.jpg"


def _make_gain(month: int, bands: int) -> ByteArray:
    shape = (HEIGHT, WIDTH)
    coast = cv2.resize(packed_maps(1)[0][..., 3], (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    land = (coast > 128 + 4).astype(np.uint8)
    lut, channels = to_reflectance(), []
    images = [decode_map(_name(m), cv2.IMREAD_COLOR, (WIDTH, HEIGHT))[..., ::-1] for m in (month, _MAP_MONTH)]
    if bands == 1:
        now, august = (sum(w * lut[image[..., k]] for k, w in enumerate(PAN_WEIGHTS)) for image in images)
        channels.append((np.asarray(now), np.asarray(august)))
    else:
        channels.extend((lut[images[0][..., k]], lut[images[1][..., k]]) for k in range(3))
    logs = [np.log2((now + _EPSILON) / (august + _EPSILON)).astype(np.float32) for now, august in channels]
    filled = [land_only(log, land) for log in logs]
    encoded = [np.clip(128 + 127 / OCTAVES * log + 0.5, 0, 255).astype(np.uint8) for log in filled]
    if bands == 1:
        return np.ascontiguousarray(encoded[0])
    return np.ascontiguousarray(np.dstack([*encoded, np.full(shape, 255, np.uint8)]))


def relief() -> ByteArray:
    """(2016, 4032, 4): slope to the east, slope to the north, roughness, 255."""
    key = f"relief-{_VERSION}-{asset_size(HEIGHT_MAP)}"
    return cached_array(key, _make_relief)


def _make_relief() -> ByteArray:
    height = decode_map(HEIGHT_MAP, cv2.IMREAD_GRAYSCALE, None).astype(np.float32) * HEIGHT_M_PER_COUNT
    rows, columns = height.shape
    texel_m = np.pi * 6_378_137.0 / rows
    latitude = np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi
    # the date line is an edge like any other: what is wrong there is a texel wide
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
    full = np.full((rows, columns), 255, np.uint8)
    return np.asarray(cv2.merge([*slopes, cv2.convertScaleAbs(rough), full]), np.uint8)
