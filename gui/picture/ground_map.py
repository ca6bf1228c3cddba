"""The ground as a map with day and night: low-resolution layers of the Earth or the Moon."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import DAY, NIGHT, decode_file
from flyaround.simulator.render.moon.moon_pass import moon_map
from flyaround.simulator.scene.illumination.irradiance import albedo_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array
    from flyaround.simulator.world.ephemeris.body import Body

WIDTH_PX, HEIGHT_PX = 720, 360
NIGHT_SHARE = 0.22
"""Night brightness over that of day, so that coasts stay visible."""
TWILIGHT_SINE = math.sin(math.radians(6.0))
"""Sine of the Sun's elevation at the end of civil twilight."""
DIMMED = 0.8
"""Brightness of the whole map, below tracks and text."""


@dataclass(frozen=True, eq=False)
class GroundMap:
    """Equirectangular maps of a body, from 180 degrees west and from the north.

    Parameters
    ----------
    day : Float32Array
        (360, 720, 3) RGB of the sunlit ground, 0..255.
    night : Float32Array
        (360, 720, 3) RGB of the ground at night, 0..255.
    """

    day: Float32Array
    night: Float32Array

    def lit(self, subsolar_latitude_deg: float, subsolar_longitude_deg: float) -> ByteArray:
        """Return (360, 720, 3) RGB: day where the Sun is up, city lights elsewhere, twilight between."""
        latitude = np.radians(90.0 - (np.arange(HEIGHT_PX, dtype=np.float32) + 0.5) * 180.0 / HEIGHT_PX)
        longitude = np.radians((np.arange(WIDTH_PX, dtype=np.float32) + 0.5) * 360.0 / WIDTH_PX - 180.0)
        sun_lat, sun_lon = math.radians(subsolar_latitude_deg), math.radians(subsolar_longitude_deg)
        up = np.sin(latitude)[:, None] * math.sin(sun_lat)
        up = up + np.cos(latitude)[:, None] * math.cos(sun_lat) * np.cos(longitude - sun_lon)[None, :]
        day = np.clip(up / TWILIGHT_SINE + 1.0, 0.0, 1.0)[..., None].astype(np.float32)
        return (self.night + day * (self.day - self.night)).astype(np.uint8)


def load_ground_map(body: Body) -> GroundMap:
    """Return the maps of a body, in a few tenths of a second.

    Raises
    ------
    UserError
        If a map is missing or damaged.
    """
    return _MAPS[body.surface](body)


def _earth_map(_: Body) -> GroundMap:
    day = _reduced(DAY) * np.float32(DIMMED)
    return GroundMap(day, np.minimum(NIGHT_SHARE * day + 0.9 * _reduced(NIGHT), 255.0))


def _grey_map(ground: ByteArray | Float32Array) -> GroundMap:
    grey = cv2.resize(ground, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    bright = np.asarray(grey, np.float32) / max(float(np.max(grey)), 1e-6) * 255 * DIMMED
    day = np.repeat(bright.reshape(HEIGHT_PX, WIDTH_PX, 1), 3, axis=2)
    return GroundMap(day, day * np.float32(NIGHT_SHARE))


_MAPS: dict[str, Callable[[Body], GroundMap]] = {
    "earth": _earth_map,
    "moon": lambda _: _grey_map(moon_map()),
    "globe": lambda body: _grey_map(albedo_of(body)),
}
"""Map functions by the name of the body's passes."""


def _reduced(name: str) -> Float32Array:
    # a JPEG decodes to an eighth of its size at a fraction of the cost
    image = decode_file(name, cv2.IMREAD_REDUCED_COLOR_8)[..., ::-1]
    return np.asarray(cv2.resize(image, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA), np.float32)
