"""Sea ice through the year: a climatology, because the maps show open water in every month.

The edges of the largest and the smallest ice cover were drawn by hand. The edge of a month is interpolated between them
so that the enclosed area equals the month's extent. The extents are rounded means of 1981-2010 (NSIDC's Sea Ice Index,
Fetterer et al. 2017). Tongues, bays and leads are random and do not depend on the date.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.world.constants import EARTH_MEAN_RADIUS_M
from flyaround.simulator.world.time.instant import datetime_utc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

# Size of the map [px], 0.25 deg per pixel.
WIDTH, HEIGHT = 1440, 720
EDGE_DEG = 1.6  # width of the marginal zone of floes, from open water to the pack
_PACK_CONCENTRATION = 0.93  # ice concentration of the pack
_TONGUES_DEG = 0.9  # standard deviation of the edge's latitude
_LEADS = 0.10  # share of the pack that opens as leads, at the peaks of the noise

# Length of a year [days].
_YEAR = 365.25
# latitude of the edge [deg] at longitudes [deg] from the date line eastward; 90: none
# fmt: off
_NORTH_LARGEST = (
    (-180, 60), (-172, 57.5), (-160, 57.5), (-155, 60), (-135, 66), (-120, 62), (-95, 55), (-80, 51), (-70, 51),
    (-64, 46.5), (-58, 47), (-55, 49), (-53.5, 53), (-53, 60), (-52, 67), (-47, 64), (-44, 59.5), (-42, 61), (-39, 64),
    (-35, 65.5), (-30, 66.3), (-25, 67.8), (-20, 69.5), (-15, 71), (-10, 72), (-5, 73), (0, 75), (5, 77.5), (9, 79.5),
    (14, 79.5), (18, 76.5), (25, 75.3), (35, 75.6), (42, 74), (48, 71), (54, 69), (65, 67), (75, 65), (105, 60),
    (135, 54), (140, 51.5), (143, 46.5), (146, 45.5), (150, 51), (154, 55), (160, 59), (168, 61), (175, 61.5),
)
_NORTH_SMALLEST = tuple(zip(range(-180, 180, 15), (
    74, 73, 73, 72, 71, 70, 70, 72, 74, 76, 72, 76, 81, 82, 82, 82, 81, 80, 79, 77, 76, 74, 74, 74), strict=True))
_SOUTH_LARGEST = tuple(zip(range(-180, 180, 15), (
    63, 63, 63, 64, 64, 65, 65, 64, 61, 58, 56, 55, 55, 56, 57, 58, 59, 60, 61, 62, 62, 62, 62, 62), strict=True))
_SOUTH_SMALLEST = tuple(zip(range(-180, 180, 15), (
    74, 73, 71, 71, 72, 72, 71, 69, 66.5, 68.5, 71.5, 71.5, 70.5, 69, 68, 67, 66, 66, 66, 66, 66, 66, 68, 71),
    strict=True))
# million square kilometres, January to December
EXTENT_NORTH = (14.4, 15.3, 15.4, 14.7, 13.4, 11.8, 9.7, 7.2, 6.4, 8.9, 10.7, 12.8)
# the same around Antarctica
EXTENT_SOUTH = (5.0, 3.1, 4.0, 7.0, 10.4, 13.6, 16.2, 17.8, 18.5, 18.1, 16.0, 10.6)
# fmt: on
_MIN_LATITUDE_DEG = 40.0  # equatorward of this there is no ice

# Seed of the pattern; any fixed value serves.
_SEED = 1893
# sine of 70 degrees latitude: poleward a degree of longitude is too narrow for the grid of cells
_POLAR_SINE = 0.94


def sea_ice(epoch_utc: str) -> ByteArray:
    """Return the concentration of sea ice on a day.

    Returns
    -------
    (720, 1440) array
        Concentration, 0 to 255 for none to full cover; row 0 in the north, column 0 at -180 degrees. It depends on the
        day of the year only. Cached: callers must not write to it.
    """
    moment = datetime_utc(epoch_utc)
    return _make_sea_ice(moment.timetuple().tm_yday)


@lru_cache(maxsize=4)
def _make_sea_ice(day: int) -> ByteArray:
    longitude = (np.arange(WIDTH) + 0.5) * 360 / WIDTH - 180
    share = np.zeros((HEIGHT, WIDTH), np.uint8)
    rows = _polar_rows()
    latitude = (90 - (np.arange(rows) + 0.5) * 180 / HEIGHT).astype(np.float32)
    for largest, smallest, extents, pole in (
        (_NORTH_LARGEST, _NORTH_SMALLEST, EXTENT_NORTH, 0),
        (_SOUTH_LARGEST, _SOUTH_SMALLEST, EXTENT_SOUTH, 1),
    ):
        middles = (np.arange(12) + 0.5) / 12 * _YEAR
        extent = np.interp(day, middles, extents, period=_YEAR)
        growth = (extent - min(extents)) / (max(extents) - min(extents))
        tongues, leads, sideways = _ice_noise(pole)
        edge = growth * _edge_latitude(largest, longitude) + (1 - growth) * _edge_latitude(
            smallest, longitude
        )
        # displace sideways too, so that an edge along a meridian wanders
        meridian = (
            np.arange(WIDTH) + (_TONGUES_DEG * WIDTH / 360) * sideways / np.cos(np.radians(latitude))[:, None]
        )
        edge = edge[np.round(meridian).astype(int) % WIDTH].astype(np.float32)
        depth_deg = latitude[:, None] - edge + _TONGUES_DEG * tongues
        # 15 % of cover at the edge, by which the ice's extent is defined
        pack = np.clip(depth_deg / EDGE_DEG + 0.15, 0, 1) * (_PACK_CONCENTRATION - _LEADS * leads)
        near = np.round(pack * 255).astype(np.uint8)
        if pole == 0:
            share[:rows] = near
        else:
            share[-rows:] = near[::-1]
    return share


def near_ice(z: FloatArray, longitude: FloatArray, epoch_utc: str) -> NDArray[np.bool_]:
    """Return True where ice may lie within a degree on a day; poleward of 70 degrees always True.

    Parameters
    ----------
    z : array
        Sine of the latitude.
    longitude : array
        [rad], of the same shape. NaN gives True.
    epoch_utc : str
        Time, UTC.

    Returns
    -------
    array of bool
        Mask of the input's shape.
    """
    is_tested = np.abs(z) < _POLAR_SINE  # False for NaN
    row = (90 - np.degrees(np.arcsin(np.where(is_tested, z, 0)))).astype(int)
    column = (np.degrees(np.where(is_tested, longitude, 0)) + 180).astype(int) % 360
    where = _ice_cells(datetime_utc(epoch_utc).timetuple().tm_yday)
    return np.asarray(where[row, column] | ~is_tested)


@lru_cache(maxsize=4)
def _ice_cells(day: int) -> NDArray[np.bool_]:
    """Return (180, 360) True for one-degree cells with ice in the cell or nearby: one row, or two columns away."""
    cells = _make_sea_ice(day).reshape(180, HEIGHT // 180, 360, WIDTH // 360).max(axis=(1, 3))
    wrapped = np.pad(cells, ((1, 1), (2, 2)), mode="wrap")
    return np.asarray(cv2.dilate(wrapped, np.ones((3, 5), np.uint8))[1:-1, 2:-2] > 0)


def _polar_rows() -> int:
    return round((90 - _MIN_LATITUDE_DEG) / 180 * HEIGHT)


def _edge_latitude(points: tuple[tuple[float, float], ...], longitude: FloatArray) -> FloatArray:
    x, y = np.array(points, float).T
    return np.asarray(np.interp(longitude, x, y, period=360.0))


@lru_cache(maxsize=2)
def _ice_noise(pole: int) -> Float32Array:
    """Return (3, rows, WIDTH) noise, from the pole outwards: edge tongues, leads (0..1), sideways tongues."""
    return cached_array(entry_name("ice", (_make_ice_noise,), pole), lambda: _make_ice_noise(pole))


def _make_ice_noise(pole: int) -> Float32Array:
    """Make `_ice_noise`.

    Generated in the azimuthal projection, where it is isotropic.
    """
    size, span_deg = 512, 2 * (90 - _MIN_LATITUDE_DEG) + 4
    rng = np.random.default_rng([_SEED, pole])
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]) * size / span_deg
    spectrum = np.fft.rfft2(rng.standard_normal((3, size, size)).astype(np.float32))
    # cycles per degree: tongues of 100 to 1000 km, weaker towards fine scales; leads of 300 km; chosen by eye
    tongue = np.where(f > 0.06, (f + 0.15) ** -1.75, 0)
    shapes = tongue, np.exp(-(((f - 0.35) / 0.3) ** 2)), tongue
    fields = [np.fft.irfft2(s * shape, (size, size)) for s, shape in zip(spectrum, shapes, strict=True)]
    planes = [field / field.std() for field in fields]
    planes[1] = np.exp(-3 * np.abs(planes[1]))  # leads follow the zero crossings of a field
    away = (np.arange(_polar_rows(), dtype=np.float32)[:, None] + 0.5) * 180 / HEIGHT
    turn = (np.arange(WIDTH, dtype=np.float32)[None] + 0.5) * (2 * np.pi / WIDTH)
    scale = size / span_deg
    x, y = away * np.cos(turn) * scale + size / 2, away * np.sin(turn) * scale + size / 2
    return np.stack([cv2.remap(p.astype(np.float32), x, y, cv2.INTER_LINEAR) for p in planes])


def extent_m2(share: FloatArray, sea: FloatArray) -> tuple[float, float]:
    """Return the sea area with at least 15 % ice, the definition of extent, north and south [m2].

    Parameters
    ----------
    share : (720, 1440) array
        0..1.
    sea : (720, 1440) array
        Share of each cell that is sea, not land.
    """
    rows = np.radians(90 - np.arange(HEIGHT + 1) * 180 / HEIGHT)
    area = EARTH_MEAN_RADIUS_M**2 * np.abs(np.diff(np.sin(rows))) * 2 * np.pi / WIDTH
    # the extent counts cells with at least 15 % of ice (Fetterer et al., Sea Ice Index, NSIDC)
    area_m2 = (share >= 0.15) * sea * area[:, None]
    return float(area_m2[: HEIGHT // 2].sum()), float(area_m2[HEIGHT // 2 :].sum())
