"""The Earth's maps, packed for the shader: one RGBA texture per number of bands, equirectangular.

Channels for one band: land reflectance (square root), cloud opacity (square root), night lights, distance to the coast.
For three bands a second RGBA texture holds the land's colour (square roots) and its alpha is unused.
"""

from __future__ import annotations

import hashlib
from importlib import resources
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.errors import UserError
from simulator.render.cache import cached_array

if TYPE_CHECKING:
    from simulator.arrays import ByteArray, Float32Array

WIDTH, HEIGHT = 8064, 4032
DAY, CLOUDS = "day_2004-08_8064x4032.jpg", "clouds_8064x4032.jpg"
NIGHT, COAST = "night_8064x4032.jpg", "coast_sdf_8640x4320.png"
VERSION = 6  # of the packing below; part of the cache's key

# Blue Marble is a picture, not a measurement: a power law on its 8 bits brings desert, forest and snow to their
# broadband reflectances (0.35, 0.03-0.05, 0.6-0.7; Liang 2001, Narrowband to broadband conversions)
_REFLECTANCE_SCALE, _REFLECTANCE_POWER = 0.66, 1.7
PAN_WEIGHTS = (0.443, 0.362, 0.195)  # red, green, blue; the same as simulator/scene/bands.py
_ICE_LATITUDE_DEG = 50.0  # there is none nearer to the equator
_ICE_REFLECTANCE = 0.22  # water brighter than this is ice, drawn as land


def packed_maps(bands: int) -> list[ByteArray]:
    """One (H, W, 4) texture for one band, two for three; from the cache after the first call."""
    key = hashlib.sha256(f"{VERSION} {_REFLECTANCE_SCALE} {_REFLECTANCE_POWER} {_ICE_REFLECTANCE}".encode())
    for name in (DAY, CLOUDS, NIGHT, COAST):
        key.update(f"{name} {len(asset_bytes(name))}".encode())
    stem = key.hexdigest()[:16]
    maps = [cached_array(f"earth-pan-{stem}", _pack_panchromatic)]
    if bands == 3:
        maps.append(cached_array(f"earth-rgb-{stem}", _pack_colour))
    return maps


def asset_bytes(name: str) -> bytes:
    """A file of ``assets/earth``."""
    try:
        return resources.files("assets").joinpath("earth", name).read_bytes()
    except FileNotFoundError as error:
        raise UserError(f"the map assets/earth/{name} is missing; install Flyaround again") from error


def decode_map(name: str, flags: int, size_px: tuple[int, int] | None = (WIDTH, HEIGHT)) -> ByteArray:
    """A map of the Earth as an array, reduced or enlarged to a size (width, height); ``None``: as it is.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    image = cv2.imdecode(np.frombuffer(asset_bytes(name), np.uint8), flags)
    if image is None:
        raise UserError(f"the map assets/earth/{name} cannot be decoded; install Flyaround again")
    if size_px is not None and image.shape[1::-1] != size_px:
        image = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA)
    return np.asarray(image, np.uint8)


def to_reflectance() -> Float32Array:
    """Lookup table of 256 reflectances."""
    v = np.arange(256, dtype=np.float32) / 255
    return np.asarray(_REFLECTANCE_SCALE * v**_REFLECTANCE_POWER, np.float32)


def _encode_root(reflectance: Float32Array) -> ByteArray:
    """Square root in 8 bits: even steps of what the eye, and shot noise, sees."""
    return np.asarray(cv2.convertScaleAbs(cv2.sqrt(reflectance), alpha=255.0), np.uint8)


def land_only(reflectance: Float32Array, land: ByteArray) -> Float32Array:
    """Replace the sea's values by those of the nearest land, so that a crisp coast shows no sea on its land side.

    What is filled in is smooth: it is worked out at a quarter of the size.
    """
    height, width = land.shape
    small = (width // 4, height // 4)
    weight = cv2.resize(land.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    masked = np.where(land[..., None] > 0, reflectance, 0) if reflectance.ndim == 3 else reflectance * land
    filled = cv2.resize(np.asarray(masked, np.float32), small, interpolation=cv2.INTER_AREA)
    known = weight > 1e-3
    filled[known] = (filled[known].T / weight[known]).T
    total = known.astype(np.float32)
    for size in (3, 7, 17):
        blurred = cv2.blur(filled * (total[..., None] if filled.ndim == 3 else total), (size, size))
        share = cv2.blur(total, (size, size))
        new = (total < 0.5) & (share > 1e-4)
        filled[new] = (blurred[new].T / share[new]).T
        total[new] = 1
    out = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
    cv2.copyTo(reflectance, land, out)
    return np.asarray(out, np.float32)


def _panchromatic(day_bgr: ByteArray) -> Float32Array:
    lut = to_reflectance()
    total = cv2.LUT(np.ascontiguousarray(day_bgr[..., 2]), lut * np.float32(PAN_WEIGHTS[0]))
    for channel, weight in ((1, PAN_WEIGHTS[1]), (0, PAN_WEIGHTS[2])):
        cv2.add(
            total, cv2.LUT(np.ascontiguousarray(day_bgr[..., channel]), lut * np.float32(weight)), dst=total
        )
    return np.asarray(total, np.float32)


def _coast_and_ice(day_bgr: ByteArray) -> tuple[ByteArray, Float32Array]:
    """Distance to the coast with the sea ice counted as land, and the panchromatic reflectance."""
    coast, reflectance = decode_map(COAST, cv2.IMREAD_GRAYSCALE), _panchromatic(day_bgr)
    # nearer to the equator what shines beside water is desert, and would close its gulfs
    edge = int(HEIGHT * (0.5 - _ICE_LATITUDE_DEG / 180))
    for rows in (slice(0, edge), slice(HEIGHT - edge, HEIGHT)):
        smooth = cv2.GaussianBlur(reflectance[rows], (0, 0), 1.5)
        ice = cv2.convertScaleAbs(np.clip(128 + (smooth - _ICE_REFLECTANCE) * 400, 0, 200))
        ice[ice <= 120] = 0
        coast[rows] = np.maximum(coast[rows], ice)
    return coast, reflectance


def _pack_panchromatic() -> ByteArray:
    day = decode_map(DAY, cv2.IMREAD_COLOR)
    coast, reflectance = _coast_and_ice(day)
    # two texels inland: the nearer ones are mixtures of land and sea
    land = land_only(reflectance, (coast > 128 + 12).astype(np.uint8))
    clouds, night = decode_map(CLOUDS, cv2.IMREAD_GRAYSCALE), decode_map(NIGHT, cv2.IMREAD_GRAYSCALE)
    # the picture of the clouds shows their light: thin ones cover more than they whiten
    thin = cv2.LUT(clouds, np.round(np.sqrt(np.arange(256) / 255) * 255).astype(np.uint8))
    return np.asarray(cv2.merge([_encode_root(land), thin, night, coast]), np.uint8)


def _pack_colour() -> ByteArray:
    day = decode_map(DAY, cv2.IMREAD_COLOR)
    coast, _ = _coast_and_ice(day)
    colour = np.asarray(cv2.LUT(np.ascontiguousarray(day[..., ::-1]), to_reflectance()), np.float32)
    land = land_only(colour, (coast > 128 + 12).astype(np.uint8))
    return np.ascontiguousarray(np.dstack([_encode_root(land), np.full((HEIGHT, WIDTH), 255, np.uint8)]))
