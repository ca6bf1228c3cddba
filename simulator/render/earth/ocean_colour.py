"""Ocean colour: reflectance of shallow and turbid water above that of the open ocean, from the day map.

Banks, reefs, rivers' plumes, lakes full of silt. ``assets/earth/ocean_colour_mask_720x360.png`` says where they are: a
tile of the screen that is not near one does not look them up. `python -m flyaround.simulator.render.earth.ocean_colour` makes it.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.render.earth.maps import (
    COAST,
    DAY,
    PAN_WEIGHTS,
    DecodedMaps,
    asset_size,
    day_map,
    decode_file,
    decode_map,
)
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array, is_cached

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.render.earth.maps import Decoder
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

    Sources = tuple[ByteArray, ByteArray]

WIDTH, HEIGHT = 4032, 2016
MASK = "ocean_colour_mask_720x360.png"
SCALE = 0.35  # reflectance of a map's texel that is as blue as can be: clear shallows over white sand (Maritorena 1994)
_POWER = 1.2  # of the map's 8 bits: nearly straight, where the land's darker values are pressed together
_DEEP = (2.0, 5.0, 20.0)  # what the map paints the open ocean with: red, green, blue
_NOTHING = 2.5  # counts over it that are only the picture's compression
_ICE = 60.0  # counts in every channel: floating ice, not water
_OFFSHORE = 24  # counts of the coast's distance (7 km): nearer texels are mixtures with land
_ASHORE = 7  # texels over which what is offshore is carried to the shore
_NOTICED = 0.01  # reflectance for which a cell of the screen looks
VERSION = 2  # of `_make`: raise it when the same maps give another
# most of the sea is deep
_TILES = [
    (slice(row, row + 36), slice(column, column + 72))
    for row in range(0, HEIGHT, 36)
    for column in range(0, WIDTH, 72)
]


def ocean_colour(bands: int, sources: Sources | None = None) -> ByteArray:
    """(2016, 4032) or (2016, 4032, 4): square root of the reflectance over the open ocean's, over ``SCALE``.

    Parameters
    ----------
    sources : where they are at hand; otherwise the maps are decoded.
    """
    return cached_array(_key(bands), lambda: _make(bands, day_and_coast() if sources is None else sources))


def sources_to_decode(bands: int, files: DecodedMaps) -> Sources | None:
    """Sources of `ocean_colour`, from maps that are decoded for others too; ``None`` where the cache has the result."""
    return None if is_cached(_key(bands)) else day_and_coast(files)


def _key(bands: int) -> str:
    sizes = [asset_size(name) for name in (DAY, COAST, MASK)]
    return entry_name(f"ocean-colour-{bands}", VERSION, bands, sizes)


def _make(bands: int, sources: Sources) -> ByteArray:
    # nothing is left where no cell looks
    core = cv2.erode(_mask().astype(np.float32), np.ones((3, 3)))
    share = cv2.resize(core, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    day, coast = sources
    out = np.zeros((HEIGHT, WIDTH) if bands == 1 else (HEIGHT, WIDTH, 4), np.uint8)
    if bands != 1:
        out[..., 3] = 255

    for whole in _TILES:  # one by one: threads would wait for Python at each of their short steps
        tile = _within(whole, share[whole] > 0)
        near = share[tile] > 0
        if not near.size:
            continue
        over = _reflectance(_excess_over_open_ocean(day, coast, *tile)[near]) * share[tile][near][:, None]
        if bands == 1:
            out[tile][near] = _bytes(np.sqrt(over @ np.array(PAN_WEIGHTS, np.float32)))
        else:
            out[(*tile, slice(0, 3))][near] = _bytes(np.sqrt(over))
    return out


def _within(tile: tuple[slice, slice], wanted: NDArray[np.bool_]) -> tuple[slice, slice]:
    """The part of a tile that bounds what is wanted (R, C) in it."""
    rows, columns = (np.flatnonzero(wanted.any(axis=k)) for k in (1, 0))
    ranges = [(found[0], found[-1] + 1) if len(found) else (0, 0) for found in (rows, columns)]
    first, second = (
        slice(x.start + int(a), x.start + int(b)) for x, (a, b) in zip(tile, ranges, strict=True)
    )
    return first, second


def day_and_coast(decode: Decoder = decode_file) -> Sources:
    """(2016, 4032, 3) red, green, blue and (2016, 4032) distance to the coast, of the maps."""
    with ThreadPoolExecutor(2) as pool:
        day = pool.submit(day_map, decode, (WIDTH, HEIGHT))
        coast = decode_map(COAST, cv2.IMREAD_GRAYSCALE, (WIDTH, HEIGHT), decode)
        return day.result()[..., ::-1], coast


def _excess_over_open_ocean(day: ByteArray, coast: ByteArray, rows: slice, columns: slice) -> Float32Array:
    """(R, C, 3) of the map's 8 bits over the open ocean's in some rows and columns, 0..1."""
    # what lies around a texel is looked at beyond the tile
    ranges = [
        (max(x.start - _ASHORE, 0), min(x.stop + _ASHORE, size), x)
        for x, size in ((rows, HEIGHT), (columns, WIDTH))
    ]
    around = tuple(slice(low, high) for low, high, _ in ranges)
    within = tuple(slice(x.start - low, x.stop - low) for low, _, x in ranges)
    bright = day[around].astype(np.float32)
    over = np.clip(bright - (np.array(_DEEP, np.float32) + np.float32(_NOTHING)), 0, None)
    over *= np.float32(1 / (255 - _NOTHING))
    red, green, blue = cv2.split(bright)
    sea = ((coast[around] < 128 - _OFFSHORE) & (cv2.min(cv2.min(red, green), blue) < _ICE)).astype(np.float32)
    # beside the shore, and under ice, the water is as it is further out
    known = cv2.blur(sea, (_ASHORE, _ASHORE))[within]
    carried = cv2.blur(over * sea[..., None], (_ASHORE, _ASHORE))[within]
    carried *= ((known > 0) / np.maximum(known, 1e-3))[..., None].astype(np.float32)
    return np.where(sea[within][..., None] > 0, over[within], carried)


def _reflectance(over: Float32Array) -> Float32Array:
    """Over the open ocean's, over ``SCALE``, of what `_excess_over_open_ocean` gives."""
    return np.asarray(cv2.pow(over, _POWER), np.float32)


def _bytes(values: NDArray[np.float32]) -> ByteArray:
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)


@lru_cache(maxsize=1)
def _mask() -> NDArray[np.bool_]:
    return decode_map(MASK, cv2.IMREAD_GRAYSCALE, None) > 0


def near_bright_water(z: FloatArray, longitude: FloatArray) -> NDArray[np.bool_]:
    """Whether there is shallow or turbid water within half a degree or a degree.

    Parameters
    ----------
    z : sine of the latitude. longitude : [rad]; of the same shape as z. NaN gives False.
    """
    known = np.isfinite(z) & np.isfinite(longitude)
    row = np.clip(180 - 2 * np.degrees(np.arcsin(np.clip(np.where(known, z, 0), -1, 1))), 0, 359).astype(int)
    column = (2 * np.degrees(np.where(known, longitude, 0)) + 360).astype(int) % 720
    return np.asarray(_mask()[row, column] & known)


def make_mask() -> ByteArray:
    """(360, 720) 255 where the water is noticeably brighter than the open ocean, and half a degree around it."""
    day, coast = day_and_coast()
    over = _excess_over_open_ocean(day, coast, slice(0, HEIGHT), slice(0, WIDTH))
    bright = SCALE * _reflectance(over).max(axis=2) > _NOTICED
    # rows and columns do not divide by whole texels: each half degree takes what touches it
    found = np.zeros((360, 720), np.uint8)
    row, column = np.nonzero(bright & (coast < 128 - _OFFSHORE))
    found[row * 360 // HEIGHT, column * 720 // WIDTH] = 255
    wrapped = np.pad(found, ((1, 1), (1, 1)), mode="wrap")
    return np.asarray(cv2.dilate(wrapped, np.ones((3, 3), np.uint8))[1:-1, 1:-1], np.uint8)


if __name__ == "__main__":
    path = Path(__file__).parents[3] / "assets" / "earth" / MASK
    path.write_bytes(cv2.imencode(".png", make_mask(), [cv2.IMWRITE_PNG_BILEVEL, 1])[1].tobytes())
