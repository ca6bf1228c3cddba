"""Albedo of the Earth seen from space: ground, air, clouds and the sea ice of the day.

`python -m tools.cook` derives it from the maps that draw the Earth.
"""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_maps import asset_bytes
from flyaround.simulator.celestial.sea_ice import sea_ice
from flyaround.simulator.scene.illumination.bands import bands_of, sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.irradiance import (
    albedo_of,
    dark_field,
    globe_shine,
    moon_plate_irradiance,
)
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.time.instant import datetime_utc

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.scene.state import SceneState

# Albedos of open sea (0.06 in diffuse light: Payne 1972, J. Atmos. Sci. 29, 959), of clear air and of full cloud cover.
# The last two set contrasts only: with clouds, the map is scaled to the Earth's albedo (tools/cook/reduced_maps.py).
SEA_ALBEDO, AIR_ALBEDO, CLOUD_ALBEDO = 0.06, 0.06, 0.55
ICE_ALBEDO = 0.55  # albedo of the ice pack as drawn: floes, leads and ponds
ALBEDO = "albedo_128x64.npy"

# Width and height of the albedo map [cells].
MAP_SIZE = (128, 64)


def albedo_map(*, clouds: bool) -> Float32Array:
    """Return (64, 128) albedo of ground, air and clouds over open sea, from the maps that draw the Earth.

    With clouds its mean is that of the Earth.
    """
    return _reduced_maps(clouds)[0]


def albedo_of_day(epoch_utc: str, *, clouds: bool, ice: bool) -> Float32Array:
    """Return the Earth's albedo on a day, with sea ice if ``ice`` is True.

    Returns
    -------
    (64, 128) array
        Albedo, float32, as `albedo_map` returns it. With clouds its mean is that of the Earth also with ice. Cached:
        callers must not write to it.
    """
    if not ice:
        return albedo_map(clouds=clouds)
    day = datetime_utc(epoch_utc)
    return _with_ice(day.year, day.timetuple().tm_yday, clouds)


@lru_cache(maxsize=4)
def _with_ice(year: int, day: int, clouds: bool) -> Float32Array:  # noqa: FBT001 - a key of the cache
    albedo, sea = _reduced_maps(clouds)
    epoch = datetime(year, 1, 1, tzinfo=UTC) + timedelta(days=day - 1)
    ice = (
        cv2.resize(sea_ice(epoch.isoformat()), MAP_SIZE, interpolation=cv2.INTER_AREA).astype(np.float32)
        / 255
    )
    iced = albedo + sea * ice * (ICE_ALBEDO - SEA_ALBEDO)
    return np.asarray(iced * (EARTH.albedo / mean_albedo(iced) if clouds else 1.0), np.float32)


@cache
def _reduced_maps(clouds: bool) -> Float32Array:  # noqa: FBT001 - a key of the cache
    """Return (2, 64, 128): albedo, and its derivative by the albedo of the sea."""
    return np.load(io.BytesIO(asset_bytes(ALBEDO)))[int(clouds)]


def mean_albedo(cells: FloatArray | Float32Array) -> float:
    """Average an equirectangular map over the sphere.

    Returns
    -------
    float
        Mean of the cells, weighted by their area.
    """
    weight = np.cos((np.arange(len(cells)) + 0.5) / len(cells) * np.pi - np.pi / 2)[:, None]
    return float((cells * weight).sum() / (weight.sum() * cells.shape[1]))


def globe_and_moon_shine(scene: SceneState) -> IrradianceField:
    """Return the light of globe and Moon on the target.

    Returns
    -------
    IrradianceField
        Irradiance by the direction of a face, camera frame [W m-2]; dark without ``environment.earthshine``.
    """
    bands = len(bands_of(scene.bands))
    if not scene.environment.earthshine:
        return dark_field(bands)
    R_ce = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    globe, r_target = scene.globe, np.asarray(scene.r_target_eci_m)
    R_ge, centre = globe.R_fixed_from_eci, np.asarray(globe.r_eci_m)
    sun_eci, sun_w_m2 = _sun_at_globe(scene)
    return globe_shine(
        R_ge @ (r_target - centre),
        R_ge @ sun_eci,
        R_ce @ R_ge.T,
        sun_w_m2,
        _ALBEDOS[globe.body.surface](scene),
        globe.body.mean_radius_m,
        moon_on_plates(scene),
    )


def moon_on_plates(scene: SceneState) -> FloatArray:
    """Return the Moon's `moon_plate_irradiance` at the target.

    Returns
    -------
    (P, n) array
        Irradiance per band [W m-2] on the plates of `moon_plate_irradiance`.
    """
    to_moon = np.subtract(scene.body("moon").r_eci_m, scene.r_target_eci_m)
    sun_eci, sun_w_m2 = _sun_at_globe(scene)
    return moon_plate_irradiance(to_moon, sun_eci, matrix_from_quat(scene.q_camera_from_eci_wxyz), sun_w_m2)


def _sun_at_globe(scene: SceneState) -> tuple[FloatArray, FloatArray]:
    """Return the unit vector from the globe to the Sun, GCRS axes, and its irradiance per band [W m-2]."""
    to_sun = np.subtract(scene.r_sun_eci_m, scene.globe.r_eci_m)
    distance = float(np.linalg.norm(to_sun))
    return to_sun / distance, sun_irradiance_w_m2(scene.bands, distance)


def _earth_albedo(scene: SceneState) -> Float32Array:
    environment = scene.environment
    return albedo_of_day(scene.epoch_utc, clouds=environment.clouds, ice=environment.sea_ice)


_ALBEDOS: dict[str, Callable[[SceneState], Float32Array]] = {
    "earth": _earth_albedo,
    "globe": lambda scene: albedo_of(scene.globe.body),
}
"""Albedo functions by the name of the globe's pass."""
