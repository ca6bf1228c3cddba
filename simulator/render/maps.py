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
VERSION = 4  # of the packing below; part of the cache's key

# Blue Marble is a picture, not a measurement: a power law on its 8 bits brings desert, forest and snow to their
# broadband reflectances (0.35, 0.03-0.05, 0.6-0.7; Liang 2001, Narrowband to broadband conversions)
_REFLECTANCE_SCALE, _REFLECTANCE_POWER = 0.66, 1.7
PAN_WEIGHTS = (0.443, 0.362, 0.195)  # red, green, blue; the same as simulator/scene/bands.py
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
    return np.asarray(np.clip(np.sqrt(reflectance) * 255 + 0.5, 0, 255), np.uint8)


def land_only(reflectance: Float32Array, land: ByteArray) -> Float32Array:
    """Replace the sea's values by those of the nearest land, so that a crisp coast shows no sea on its land side."""
    weight = land.astype(np.float32)
    filled, total = reflectance * weight[..., None] if reflectance.ndim == 3 else reflectance * weight, weight
    for size in (5, 21, 65):
        blurred = cv2.blur(filled, (size, size), borderType=cv2.BORDER_REPLICATE)
        share = cv2.blur(total, (size, size), borderType=cv2.BORDER_REPLICATE)
        new = (total < 0.5) & (share > 1e-4)
        filled[new] = (blurred[new].T / share[new]).T
        total = np.where(new, np.float32(1), total)
    return np.where((land > 0)[..., None] if filled.ndim == 3 else land > 0, reflectance, filled).astype(
        np.float32
    )


def _panchromatic(day_bgr: ByteArray) -> Float32Array:
    lut = to_reflectance()
    return np.asarray(sum(w * lut[day_bgr[..., 2 - k]] for k, w in enumerate(PAN_WEIGHTS)), np.float32)


def _coast_and_ice(day_bgr: ByteArray) -> tuple[ByteArray, Float32Array]:
    """Distance to the coast with the sea ice counted as land, and the panchromatic reflectance."""
    coast, reflectance = decode_map(COAST, cv2.IMREAD_GRAYSCALE), _panchromatic(day_bgr)
    smooth = cv2.GaussianBlur(reflectance, (0, 0), 1.5)
    ice = np.clip(128 + (smooth - _ICE_REFLECTANCE) * 400, 0, 200)
    return np.maximum(coast, np.where(ice > 120, ice, 0)).astype(np.uint8), reflectance


def _pack_panchromatic() -> ByteArray:
    day = decode_map(DAY, cv2.IMREAD_COLOR)
    coast, reflectance = _coast_and_ice(day)
    # two texels inland: the nearer ones are mixtures of land and sea
    land = land_only(reflectance, (coast > 128 + 12).astype(np.uint8))
    clouds, night = decode_map(CLOUDS, cv2.IMREAD_GRAYSCALE), decode_map(NIGHT, cv2.IMREAD_GRAYSCALE)
    # the picture of the clouds shows their light: thin ones cover more than they whiten
    thin = _encode_root(np.asarray(clouds, np.float32) / np.float32(255))
    return np.ascontiguousarray(np.dstack([_encode_root(land), thin, night, coast]))


def _pack_colour() -> ByteArray:
    day = decode_map(DAY, cv2.IMREAD_COLOR)
    coast, _ = _coast_and_ice(day)
    colour = to_reflectance()[day[..., ::-1]]
    land = land_only(colour, (coast > 128 + 12).astype(np.uint8))
    return np.ascontiguousarray(np.dstack([_encode_root(land), np.full((HEIGHT, WIDTH), 255, np.uint8)]))
