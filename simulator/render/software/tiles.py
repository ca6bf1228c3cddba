"""Tiles of the screen: which of them the Earth touches, and which are smooth enough to be interpolated."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.earth.ocean_colour import near_shoals
from simulator.render.earth.screen_tiles import ICE_SINE, ScreenTiles, TileKind, tile_edges, tile_size_px
from simulator.render.earth.sea_ice import near_ice
from simulator.render.projection import directions
from simulator.render.target.viewport_fit import TILE_PX
from simulator.render.view import EQUATOR_M

if TYPE_CHECKING:
    from simulator.camera.lens.camera_model import Camera
    from simulator.render.earth.earth_view import EarthView
    from simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

_SMOOTH_DISC = (
    0.08  # square of the ray's depth under the sphere, 1 at the nadir: up to 73 degrees from the vertical
)
_FINE_DISC = 0.02  # of tiles half as wide, between which the ground bends as much: up to 82 degrees
_FINE_KM = 1.6  # largest footprint of a pixel in them: beyond it clouds and floes are averaged
_LARGEST_GROUND = 0.015  # of a tile on the ground [radii]: light and air are even enough over 100 km
_POLE_SINE = 0.995  # the maps' longitude bends too fast nearer to the poles
_LEVEL_STEP = 0.5  # of the levels of detail: a smooth tile has one for all its pixels
# of a tile on the ground [radii]: one degree; larger ones may hold shoals between their corners
_LARGEST_OPEN = 0.017
_MOONLIT_MU = -0.06  # of the same: there moonlight begins to count, shaders/earth/point.glsl
_NIGHT_MU = 0.03  # cosine of the Sun's zenith angle: city lights are out where it is higher


def earth_tiles(earth: EarthView, camera: Camera, target_px: FloatArray | None, day: str) -> ScreenTiles:
    """Cut the image into tiles and sort them.

    Parameters
    ----------
    target_px : (K, 2) centres of the tiles (`coverage_mask`) that the target may touch, ``None`` without target.
    day : ISO 8601, whose sea ice is drawn.
    """
    pixel_rad, size = camera.pixel_angle_rad(), tile_size_px(camera)
    bent = not camera.distortion.is_none
    x, y = tile_edges(camera.width_px, size), tile_edges(camera.height_px, size)
    d = directions(camera, x, y, earth.earth_from_camera)
    along = d @ earth.camera
    perigee2 = np.maximum(float(earth.camera @ earth.camera) - along**2, 0)
    disc = 1 - perigee2
    smooth_corner = (along < 0) & (disc > _SMOOTH_DISC)
    depth = np.sqrt(np.maximum(disc, 0))
    distance = -along - depth
    off_pole = np.abs(earth.camera[2] + distance * d[..., 2]) < _POLE_SINE
    # footprint: the mean of its two axes, as in shaders/earth/point.glsl
    footprint_km = distance * EQUATOR_M * 1e-3 * pixel_rad / np.sqrt(np.fmax(depth, 0.02))
    # seen from far away a tile spans much of the Earth
    ground_span = distance * size * pixel_rad
    smooth = _all_corners(smooth_corner & off_pole & (ground_span < _LARGEST_GROUND * depth))
    fine_corner = (along < 0) & (disc > _FINE_DISC) & off_pole & (footprint_km < _FINE_KM)
    # their quarters are of whole pixels by four
    fine_corner &= (0.5 * ground_span < _LARGEST_GROUND * depth) & (size % 8 == 0)
    fine = _all_corners(fine_corner)
    if bent:
        # a lens's rays are known inside the image only, and a tile must know those of its corners
        inside = (x[1:] < camera.width_px)[None, :] & (y[1:] < camera.height_px)[:, None]
        smooth &= inside
        fine &= inside
    fine &= ~smooth
    # a ray's perigee moves by at most the camera's distance times the angle: within a tile, half its diagonal
    reach = float(np.linalg.norm(earth.camera)) * 0.75 * size * pixel_rad * 1.01
    touched_corner = (along < reach) & (np.sqrt(perigee2) < np.sqrt(earth.top2) + reach)
    touched = ~_all_corners(~touched_corner)
    air = _all_corners((along < 0) & (np.sqrt(perigee2) > 1 + reach))
    covered = np.zeros_like(smooth)
    if target_px is not None:
        # a tile of the target's is no larger than one of these: it lies in those of its corners, mostly in one
        first_px = (target_px - (TILE_PX - 1) / 2).astype(np.int32)
        low, high = first_px // size, (first_px + TILE_PX - 1) // size
        last = (len(x) - 2, len(y) - 2)
        ends = (low,) if np.array_equal(low, high) else (low, high)
        for column, row in itertools.product(ends, ends):
            covered[np.minimum(row[:, 1], last[1]), np.minimum(column[:, 0], last[0])] = True
    sun = earth.camera @ earth.sun + distance * (d @ earth.sun)
    night = ~(_all_corners(sun > _NIGHT_MU) & (smooth | fine))
    # a tile seen from far away, or over the limb, reaches beyond its corners
    span = ground_span / np.fmax(depth, 0.1)
    ground = [earth.camera[k] + distance * d[..., k] for k in range(3)]
    longitude, narrow = np.arctan2(ground[1], ground[0]), ~(span > _LARGEST_OPEN)
    no_ice = (np.abs(ground[2]) + span < ICE_SINE) | (~near_ice(ground[2], longitude, day) & narrow)
    icy = ~_all_corners(no_ice)
    deep = ~near_shoals(ground[2], longitude) & narrow
    shoal = ~_all_corners(deep)
    height = np.log2(np.fmax(footprint_km, 1e-6)) / _LEVEL_STEP
    # one number per kind of tile
    kind = covered * 2 + air * 32 + ~air * (shoal * 16 + icy * 8 + night) + (smooth | fine) * 4
    level = np.where(smooth, np.round(height[:-1, :-1]), 0).astype(int)
    drawn = touched & ~fine

    def middles(row: IntArray, column: IntArray) -> Float32Array:
        return np.stack([x[column], y[row]], axis=1).astype(np.float32) + np.float32(size / 2)

    codes, centers = (kind + level * 128)[drawn], middles(*drawn.nonzero())
    halved_row, halved_column = fine.nonzero()
    halved = halved_row.astype(np.int64), halved_column.astype(np.int64)
    if len(halved[0]):
        # middles of the quarters, and their levels between those of the tile's corners: rather sharp than blurred
        whole, levels = middles(*halved), height[:-1, :-1][halved]
        step = [height[1:, :-1][halved] - levels, height[:-1, 1:][halved] - levels]
        for down, right in itertools.product((0.25, 0.75), repeat=2):
            level = np.floor(levels + down * step[0] + right * step[1]).astype(int)
            codes = np.append(codes, kind[halved] + 64 + level * 128)
            offset = np.array([right - 0.5, down - 0.5], np.float32) * np.float32(size)
            centers = np.concatenate([centers, whole + offset])
    return ScreenTiles(
        size,
        (size * (len(x) - 1), size * (len(y) - 1)),
        {_kind(k): centers[codes == k] for k in map(int, np.unique(codes))},
        middles(*(~(touched & (smooth | fine))).nonzero()),
        bool(np.min(sun) < _MOONLIT_MU),
        halved,
    )


def _kind(code: int) -> TileKind:
    return TileKind(
        smooth=bool(code & 4),
        covered=bool(code & 2),
        night=bool(code & 1),
        icy=bool(code & 8),
        shoal=bool(code & 16),
        level=(code >> 7) * _LEVEL_STEP,
        air=bool(code & 32),
        fine=bool(code & 64),
    )


def _all_corners(values: BoolArray) -> BoolArray:
    return values[:-1, :-1] & values[:-1, 1:] & values[1:, :-1] & values[1:, 1:]
