"""The Earth's maps, packed for the shader: one RGBA texture per number of bands, equirectangular.

Channels for one band: land reflectance (square root), cloud opacity (square root), light of lamps (square root of its
share of the maximum), distance to the coast.
For three bands a second RGBA texture holds the land's colour (square roots) and its alpha is unused.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib import resources
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.runtime.threads import helper_threads

if TYPE_CHECKING:
    from concurrent.futures import Future

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array

# Size of the day map [px].
WIDTH, HEIGHT = 8064, 4032
DAY, CLOUDS = "day_2004-08_8064x4032.jpg", "clouds_8064x4032.jpg"
# Channel of the first map that holds the square root of the city lights.
LIGHTS_CHANNEL = 2
NIGHT, COAST = "night_8064x4032.jpg", "coast_sdf_8640x4320.png"
TERRAIN = "terrain_detail_1024.png"
TERRAIN_SLOPE_MAX = 0.9  # full scale of its slope channels, plus and minus

# Blue Marble is an image, not a measurement. A power law of its 8-bit values gives desert and forest their broadband
# reflectances (0.35 and 0.03 to 0.05; Liang 2001, Narrowband to broadband conversions). The lower bound is the
# reflectance of a canopy in blue and red, because the dark colours of the image are too dark.
_REFLECTANCE_SCALE, _REFLECTANCE_POWER, _DARKEST = 0.66, 1.7, 0.018
# Highlights of the image are compressed: snow reflects 0.97 of visible light (Warren 1982, fig. 1).
_SNOW_FROM, _SNOW_RISE, SNOW_REFLECTANCE = 0.80, 20.0, 0.97
PAN_WEIGHTS = (0.443, 0.362, 0.195)  # red, green, blue; the same as simulator/scene/illumination/bands.py
_ICE_LATITUDE_DEG = 50.0  # equatorward of this there is no sea ice
_ICE_REFLECTANCE = 0.22  # water brighter than this is ice, drawn as land
_ICE_REACH = 8  # texels beyond a strip that the blur of the ice reads
# Maps are processed in strips that fit a processor's cache; narrower strips acquire Python's global lock too often.
# Only strips poleward of the limiting latitude are searched for ice, so a strip must end there.
_STRIPS = [slice(row, row + 112) for row in range(0, HEIGHT, 112)]


def packed_maps(bands: int) -> list[ByteArray]:
    """Return the Earth's maps, packed for the shader.

    Returns
    -------
    list of (H, W, 4) array
        8-bit textures, one for one band and two for three, with the channels that this module describes. From the cache
        after the first call.
    """
    key = maps_entry()
    maps = [cached_array(f"earth-pan-{key}", _pack_panchromatic)]
    if bands == 3:
        maps.append(cached_array(f"earth-rgb-{key}", lambda: _pack_colour(day_map(), maps[0][..., 3])))
    return maps


def maps_entry() -> str:
    """Return the name of the packed maps' cache entry, an input to the names of entries derived from them."""
    return entry_name(
        "maps", (_pack_colour,), [(name, asset_size(name)) for name in (DAY, CLOUDS, NIGHT, COAST)]
    )


def asset_size(name: str) -> int:
    """Return the size in bytes of a file of ``assets/earth``, which identifies its version.

    Raises
    ------
    UserError
        If the package lacks the file.
    """
    try:
        with resources.as_file(resources.files("flyaround.assets").joinpath("earth", name)) as path:
            return path.stat().st_size
    except FileNotFoundError as error:
        raise _missing(name) from error


def asset_bytes(name: str) -> bytes:
    """Return the contents of a file of ``assets/earth``.

    Raises
    ------
    UserError
        If the package lacks the file.
    """
    try:
        return resources.files("flyaround.assets").joinpath("earth", name).read_bytes()
    except FileNotFoundError as error:
        raise _missing(name) from error


def _missing(name: str) -> UserError:
    return UserError(f"the map assets/earth/{name} is missing; install Flyaround again")


def decode_file(name: str, flags: int) -> ByteArray:
    """Decode a map of the Earth at its own size.

    Returns
    -------
    (H, W) or (H, W, C) array
        8-bit values, as OpenCV decodes them by ``flags``: colours are blue, green, red.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    image = cv2.imdecode(np.frombuffer(asset_bytes(name), np.uint8), flags)
    if image is None:
        raise UserError(f"the map assets/earth/{name} cannot be decoded; install Flyaround again")
    return np.asarray(image, np.uint8)


def decode_map(name: str, flags: int, size_px: tuple[int, int] | None = (WIDTH, HEIGHT)) -> ByteArray:
    """Decode a map of the Earth and resize it to (width, height).

    Returns
    -------
    (H, W) or (H, W, C) array
        8-bit values as from `decode_file`, at the map's own size if ``size_px`` is None.
    """
    image = decode_file(name, flags)
    if size_px is not None and image.shape[1::-1] != size_px:
        # average when shrinking by more than a little; interpolation is faster for small changes, and as accurate
        halved = image.shape[1] >= 1.5 * size_px[0]
        method = cv2.INTER_AREA if halved else cv2.INTER_LINEAR
        image = np.asarray(cv2.resize(image, size_px, interpolation=method), np.uint8)
    return image


def day_map(size_px: tuple[int, int] = (WIDTH, HEIGHT)) -> ByteArray:
    """Return the land and sea by day.

    Returns
    -------
    (H, W, 3) array
        8-bit blue, green, red of Blue Marble, an image and not a measurement.
    """
    return decode_map(DAY, cv2.IMREAD_COLOR, size_px)


def terrain_texture() -> ByteArray:
    """Return the tiling texture of terrain.

    Returns
    -------
    (1024, 1024, 4) array
        8-bit channels: slope along u and v, ``TERRAIN_SLOPE_MAX`` at full scale; brightness of the ground; valley
        floors.
    """
    return decode_map(TERRAIN, cv2.IMREAD_UNCHANGED, None)


def to_reflectance() -> Float32Array:
    """Return the table of 256 reflectances for the levels of the day map."""
    v = np.arange(256, dtype=np.float32) / 255
    ground = np.hypot(_REFLECTANCE_SCALE * v**_REFLECTANCE_POWER, _DARKEST)
    snow = _SNOW_RISE * np.maximum(v - _SNOW_FROM, 0) ** 2
    return np.asarray(np.minimum(ground + snow, SNOW_REFLECTANCE), np.float32)


def fill_sea(values: Float32Array, land: ByteArray) -> Float32Array:
    """Replace the values of the sea by those of the nearest land, so that coasts stay sharp when the map is filtered.

    The filling is smooth, so it is computed at a quarter of the size.
    """
    height, width = land.shape
    filled = _extend_over_sea(*_quarter_size(values, land))
    out = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
    cv2.copyTo(values, land, out)
    return np.asarray(out, np.float32)


def _quarter_size(values: Float32Array, land: ByteArray) -> tuple[Float32Array, Float32Array]:
    """Return at a quarter of the size: means of the values with zero for the sea, and the share of land."""
    small = (land.shape[1] // 4, land.shape[0] // 4)
    masked = cv2.copyTo(values, land)
    mean = cv2.resize(masked, small, interpolation=cv2.INTER_AREA)
    share = cv2.resize(land.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    return np.asarray(mean, np.float32), np.asarray(share, np.float32)


def _extend_over_sea(filled: Float32Array, share: Float32Array) -> Float32Array:
    """Return the land's values extended over the sea, from the results of `_quarter_size`."""
    has_data = share > 1e-3  # a value divided by less is only rounding of the average
    filled[has_data] = (filled[has_data].T / share[has_data]).T
    total = has_data.astype(np.float32)
    for size in (3, 7, 17):
        blurred = cv2.blur(filled * (total[..., None] if filled.ndim == 3 else total), (size, size))
        neighbours = cv2.blur(total, (size, size))
        new = (total < 0.5) & (neighbours > 1e-4)
        filled[new] = (blurred[new].T / neighbours[new]).T
        total[new] = 1
    return filled


def _pack_panchromatic() -> ByteArray:
    """Return the texture of one band.

    Channels are written in place and their sources freed first: allocating takes longer than the arithmetic.
    """
    out = np.empty((HEIGHT, WIDTH, 4), np.uint8)
    # the cloud map shows brightness: thin clouds cover more than they brighten
    thin = np.round(np.sqrt(np.arange(256) / 255) * 255).astype(np.uint8)

    def clouds() -> None:
        picture = decode_map(CLOUDS, cv2.IMREAD_GRAYSCALE)
        cv2.insertChannel(cv2.LUT(picture, thin, picture), out, 1)  # in place: allocating takes longer

    # levels of the map are nearly logarithmic: their fourth power is
    squares = np.round(np.arange(256) ** 2 / 255).astype(np.uint8)

    def night() -> None:
        lights = cv2.LUT(decode_map(NIGHT, cv2.IMREAD_GRAYSCALE), squares)
        cv2.insertChannel(lights, out, LIGHTS_CHANNEL)

    with ThreadPoolExecutor(helper_threads()) as pool:
        # decode everything first: strips would compete with the decoders for Python's lock
        for channel in [pool.submit(clouds), pool.submit(night)]:
            channel.result()
        shore = pool.submit(decode_map, COAST, cv2.IMREAD_GRAYSCALE)
        day = pool.submit(day_map).result()
        shore.exception()  # both are decoded now
        wide_land = _panchromatic_land(pool, day, shore, out)
        del day, shore

        def merge(rows: slice) -> None:
            land = _enlarged_root(wide_land, rows)
            inland = _inland(np.asarray(cv2.extractChannel(out[rows], 3), np.uint8))
            cv2.copyTo(cv2.extractChannel(out[rows], 0), inland, land)
            cv2.insertChannel(land, out[rows], 0)

        list(pool.map(merge, _STRIPS))
    return out


def _panchromatic_land(
    pool: ThreadPoolExecutor, day_bgr: ByteArray, shore: Future[ByteArray], out: ByteArray
) -> Float32Array:
    """Write the square root of the reflectance and the distance to the coast, ice as land, into two channels.

    Parameters
    ----------
    pool : ThreadPoolExecutor
        Threads that share the work.
    day_bgr : (H, W, 3) array
        Day map, BGR.
    shore : Future
        Future of the distance to the coast; modified in place.
    out : (H, W, 4) array
        Map whose channels are written.

    Returns
    -------
    array
        Reflectance extended over the sea, at a quarter of the size.
    """
    coast = shore.result()
    # red, green, blue are the third, second, first channel of an OpenCV image
    table = (to_reflectance()[:, None] * np.array(PAN_WEIGHTS[::-1], np.float32))[None]
    small = (HEIGHT // 4, WIDTH // 4)
    means, shares = np.empty(small, np.float32), np.empty(small, np.float32)

    def reduce(rows: slice) -> None:
        # equatorward, bright texels beside water are desert, and would close its gulfs
        latitudes = (abs(90 - row * 180 / HEIGHT) for row in (rows.start, rows.stop))
        reach = _ICE_REACH if max(latitudes) > _ICE_LATITUDE_DEG else 0
        around = slice(max(rows.start - reach, 0), min(rows.stop + reach, HEIGHT))
        own_rows = slice(rows.start - around.start, rows.stop - around.start)
        wide = cv2.transform(cv2.LUT(day_bgr[around], table), np.ones((1, 3), np.float32))
        reflectance = np.asarray(wide[own_rows], np.float32)
        if reach:
            smooth = cv2.GaussianBlur(wide, (0, 0), 1.5)[own_rows]
            # 128 is the shore; water darker than it by 0.02 keeps its own distance to the coast
            ice = cv2.convertScaleAbs(np.clip(128 + (smooth - _ICE_REFLECTANCE) * 400, 0, 200))
            ice[ice <= 120] = 0
            coast[rows] = np.maximum(coast[rows], ice)
        cv2.insertChannel(cv2.convertScaleAbs(cv2.sqrt(reflectance), alpha=255.0), out[rows], 0)
        cv2.insertChannel(coast[rows], out[rows], 3)
        quarter = slice(rows.start // 4, rows.stop // 4)
        means[quarter], shares[quarter] = _quarter_size(reflectance, _inland(coast[rows]))

    list(pool.map(reduce, _STRIPS))
    return _extend_over_sea(means, shares)


def _pack_colour(day_bgr: ByteArray, coast: ByteArray) -> ByteArray:
    table = np.repeat(to_reflectance()[:, None], 3, axis=1)[None]
    roots = np.round(np.sqrt(to_reflectance()) * 255).astype(np.uint8)
    small = (HEIGHT // 4, WIDTH // 4)
    means, shares = np.empty((*small, 3), np.float32), np.empty(small, np.float32)

    def reduce(rows: slice) -> None:
        quarter = slice(rows.start // 4, rows.stop // 4)
        reflectance = np.asarray(cv2.LUT(day_bgr[rows], table), np.float32)
        means[quarter], shares[quarter] = _quarter_size(reflectance, _inland(coast[rows]))

    with ThreadPoolExecutor(helper_threads()) as pool:
        list(pool.map(reduce, _STRIPS))
        wide_land = _extend_over_sea(means, shares)
        out = np.empty((HEIGHT, WIDTH, 4), np.uint8)

        def merge(rows: slice) -> None:
            land = _enlarged_root(wide_land, rows)
            cv2.copyTo(cv2.LUT(day_bgr[rows], roots), _inland(coast[rows]), land)
            cv2.cvtColor(land, cv2.COLOR_BGR2RGBA, dst=out[rows])

        list(pool.map(merge, _STRIPS))
    return out


def _inland(coast: ByteArray) -> ByteArray:
    """Move the coast two texels inland: nearer texels mix land and sea."""
    return np.asarray(cv2.threshold(np.ascontiguousarray(coast), 128 + 12, 1, cv2.THRESH_BINARY)[1], np.uint8)


def _enlarged_root(reflectance: Float32Array, rows: slice) -> ByteArray:
    """Return some rows of the 8-bit square root at full size; its steps are even for the eye and for shot noise.

    Parameters
    ----------
    reflectance : (H / 4, W / 4) array
        At a quarter of the size.
    rows : slice
        Rows of the result.
    """
    first, last = rows.start // 4, -(-rows.stop // 4)
    # bilinear interpolation reads one more row
    around = slice(max(first - 1, 0), min(last + 1, len(reflectance)))
    root = cv2.convertScaleAbs(cv2.sqrt(reflectance[around]), alpha=255.0)
    large = cv2.resize(root, (WIDTH, 4 * len(root)), interpolation=cv2.INTER_LINEAR)
    start = rows.start - 4 * around.start
    return np.asarray(large[start : start + rows.stop - rows.start], np.uint8)
