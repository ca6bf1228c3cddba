"""Classification of the Earth's screen tiles: what each contains, and whether it is smooth enough to interpolate."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.celestial.air_tables import GROUND_MU_MIN
from flyaround.simulator.celestial.ocean_colour import near_bright_water
from flyaround.simulator.celestial.sea_ice import near_ice
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.craft.viewport_fit import TILE_PX
from flyaround.simulator.render.earth.earth_pass import FAR_LEVEL
from flyaround.simulator.render.earth.earth_view import EarthTilesPass
from flyaround.simulator.render.earth.screen_tiles import (
    EARTH_TILES,
    ICE_SINE,
    ScreenTiles,
    TileKind,
    ice_day,
    tile_edges,
    tile_size_px,
)
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.projection import directions
from flyaround.simulator.render.view import SCENE, VIEW
from flyaround.simulator.world.constants import EARTH_RADIUS_M

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

# Smallest squared cosine of the angle between ray and vertical at the ground, of smooth tiles: 73 degrees from the
# vertical; and of fine tiles, which are half as wide: 82 degrees.
_MIN_SMOOTH_COSINE2, _MIN_FINE_COSINE2 = 0.08, 0.02
# Largest extent on the ground [radii] of smooth tiles, over which light and air are interpolated (100 km), and of fine
# tiles.
MAX_GROUND_EXTENT, _MAX_FINE_EXTENT = 0.015, 0.06
# Smallest distance of a smooth tile from a pole, in sides of a tile. At a distance r, linear interpolation of longitude
# over a side s is off by s^2 / (8 r), a quarter of a pixel for tiles of 32 px.
MIN_POLE_DISTANCE_TILES = 16
# Quantisation of the mipmap level, which all pixels of a smooth tile share. A tile that takes another level changes at
# once: with steps of 0.5 by up to 0.3 of white in broken cloud, with these unseen, at the price of more draw calls.
_LEVEL_STEP = 0.25
# Largest extent on the ground [radii], one degree, of a tile that may count as open ocean. A larger one may contain
# bright water away from its corners.
_MAX_OPEN_WATER_EXTENT = 0.017
_MOONLIT_MU = -0.06  # sine of the Sun's elevation below which moonlight counts, shaders/earth/point.glsl
# sines of the elevations of Sun and Moon below which neither shines
_UNLIT_MU, _MOONLESS_MU = GROUND_MU_MIN - 0.005, -0.05
_NIGHT_MU = 0.03  # sine of the Sun's elevation above which city lights are off


class _CornerRays:
    """The rays through the corners of all tiles, and the ground that they meet.

    Attributes
    ----------
    directions : (N, M, 3) array
        Unit vectors, Earth-fixed frame.
    along : (N, M) array
        Dot products of the directions with the camera's position [radii].
    perigee2 : (N, M) array
        Squared distances of the rays from the Earth's centre [radii^2].
    cosine2 : (N, M) array
        ``1 - perigee2``: squared cosine of the angle from the vertical at the ground, negative beyond the limb.
    distance : (N, M) array
        Distance from the camera to the ground [radii].
    footprint_km : (N, M) array
        Footprint of a pixel on the ground.
    span : (N, M) array
        Extent of a tile on the ground, perpendicular to its ray [radii].
    """

    def __init__(self, earth: GlobeView, camera: Camera) -> None:
        self.earth, self.size_px = earth, tile_size_px(camera)
        self.pixel_rad = pixel_rad = camera.pixel_angle_rad()
        self.x_px = tile_edges(camera.width_px, self.size_px)
        self.y_px = tile_edges(camera.height_px, self.size_px)
        self.directions = directions(camera, self.x_px, self.y_px, earth.earth_from_camera)
        self.along = self.directions @ earth.camera
        self.perigee2 = np.maximum(float(earth.camera @ earth.camera) - self.along**2, 0)
        self.cosine2 = 1 - self.perigee2
        self.depth = np.sqrt(np.maximum(self.cosine2, 0))
        self.distance = -self.along - self.depth
        # the mean of both axes, as in shaders/earth/point.glsl
        self.footprint_km = (
            self.distance * EARTH_RADIUS_M * 1e-3 * pixel_rad / np.sqrt(np.fmax(self.depth, 0.02))
        )

        self.span = self.distance * self.size_px * pixel_rad
        self.ground = [earth.camera[k] + self.distance * self.directions[..., k] for k in range(3)]

    def smooth(self, camera: Camera) -> tuple[BoolArray, BoolArray]:
        """Return a mask of smooth tiles, and one of tiles that become smooth if divided into 2 x 2 fine tiles."""
        in_front, span, depth = self.along < 0, self.span, self.depth
        x, y, z = self.ground
        # a map's columns converge at a pole and wrap around on the meridian behind it; the detail noise is mirrored
        # at the equator
        clear_of_meridian = np.abs(self.earth.camera[0] * y - self.earth.camera[1] * x) > 2 * span * np.hypot(
            *self.earth.camera[:2]
        )
        is_interpolable = in_front & (
            clear_of_meridian | (self.earth.camera[0] * x + self.earth.camera[1] * y > 0)
        )
        largest, largest_at_pole = MAX_GROUND_EXTENT * depth, np.hypot(x, y) / MIN_POLE_DISTANCE_TILES
        smooth = _all_corners(
            is_interpolable
            & (self.cosine2 > _MIN_SMOOTH_COSINE2)
            & (span < np.minimum(largest, largest_at_pole))
        )
        is_interpolable &= (span < largest) | (np.abs(z) > 0.5 * span / np.fmax(depth, 0.1))
        fine_corner = (
            is_interpolable
            & (self.cosine2 > _MIN_FINE_COSINE2)
            & (0.5 * span < np.minimum(_MAX_FINE_EXTENT * depth, largest_at_pole))
        )
        # fine tiles must consist of whole 2 x 2 pixels
        fine_corner &= self.size_px % 8 == 0
        fine = _all_corners(fine_corner)
        if not camera.distortion.is_none:
            # a lens's rays are known only inside the image, and a tile needs those of its corners
            columns_inside, rows_inside = self.x_px[1:] < camera.width_px, self.y_px[1:] < camera.height_px
            smooth &= columns_inside[None, :] & rows_inside[:, None]
            fine &= columns_inside[None, :] & rows_inside[:, None]
        return smooth, fine & ~smooth

    def touched(self) -> tuple[BoolArray, BoolArray]:
        """Return a mask of tiles that the Earth or its air touches, and one of tiles that show no ground."""
        # a ray's perigee moves by at most the camera's distance times the angle: within a tile, half its diagonal
        camera = float(np.linalg.norm(self.earth.camera))
        reach, perigee = camera * 0.75 * self.size_px * self.pixel_rad * 1.01, np.sqrt(self.perigee2)
        touched = (self.along < reach) & (perigee < np.sqrt(self.earth.top2) + reach)
        air = (self.along < 0) & (perigee > 1 + reach)
        return ~_all_corners(~touched), _all_corners(air)

    def sines(self, body: FloatArray) -> FloatArray:
        """Return sines (N, M) of the elevation of a body at the ground points, given the unit vector to it."""
        return np.asarray(self.earth.camera @ body + self.distance * (self.directions @ body))

    def waters(self, day: str) -> tuple[BoolArray, BoolArray]:
        """Return a mask of tiles that may be near sea ice, and one of tiles near shallow or turbid water."""
        # a tile seen from far away, or over the limb, reaches beyond its corners
        span = self.span / np.fmax(self.depth, 0.1)
        x, y, z = self.ground
        longitude, is_narrow = np.arctan2(y, x), ~(span > _MAX_OPEN_WATER_EXTENT)
        no_ice = (np.abs(z) + span < ICE_SINE) | (~near_ice(z, longitude, day) & is_narrow)
        no_bright_water = ~near_bright_water(z, longitude) & is_narrow
        return ~_all_corners(no_ice), ~_all_corners(no_bright_water)

    def centers_px(self, row: IntArray, column: IntArray) -> Float32Array:
        """Return the centres (K, 2) [px] of tiles, by row and column."""
        corner = np.stack([self.x_px[column], self.y_px[row]], axis=1).astype(np.float32)
        return np.asarray(corner + np.float32(self.size_px / 2))


class SortedTilesPass(EarthTilesPass):
    """Divides the part of the image that the Earth touches into tiles, grouped by kind."""

    reads = (*EarthTilesPass.reads, VIEW)
    optional = (TARGET,)

    def run(self, r: PassResources) -> None:
        """Make and sort the tiles, if the Earth is in the image."""
        scene, earth, target = r[SCENE], r[GLOBE], r.find(TARGET)
        if earth.rect is not None:
            target_px = None if target is None else target.tiles_px
            moon = r[VIEW].moon_globe if r[VIEW].moon_share > 0 else None
            r[EARTH_TILES] = earth_tiles(earth, scene.camera, target_px, ice_day(scene), moon)


def earth_tiles(
    earth: GlobeView, camera: Camera, target_px: FloatArray | None, day: str, moon: FloatArray | None
) -> ScreenTiles:
    """Divide the image into tiles and group them by kind.

    Parameters
    ----------
    earth : GlobeView
        Earth in the image.
    camera : Camera
        Camera of the scene.
    target_px : (K, 2) array or None
        Centres of the tiles that the target may touch, ``None`` without target.
    day : str
        ISO 8601 day of the sea ice.
    moon : array or None
        Unit vector to the Moon, ``None`` if it gives no light.
    """
    rays = _CornerRays(earth, camera)
    size, columns, rows = rays.size_px, len(rays.x_px) - 1, len(rays.y_px) - 1
    smooth, fine = rays.smooth(camera)
    touched, air = rays.touched()
    covered = _covered_tiles((rows, columns), size, target_px)
    sun = rays.sines(earth.sun)
    night = ~(_all_corners(sun > _NIGHT_MU) & (smooth | fine))
    moonless = True if moon is None else rays.sines(moon) < _MOONLESS_MU
    unlit = _all_corners((sun < _UNLIT_MU) & moonless) & (smooth | fine)
    icy, bright_water = rays.waters(day)
    # encode the kind of a tile as one number
    ground = unlit * 128 + ~unlit * (bright_water * 16 + icy * 8)
    kind = covered * 2 + air * 32 + ~air * (ground + night) + (smooth | fine) * 4
    log2_footprint = np.log2(np.fmax(rays.footprint_km, 1e-6)) / _LEVEL_STEP
    level = np.where(smooth, np.round(log2_footprint[:-1, :-1]), 0).astype(int)
    is_whole = touched & ~fine
    codes, centers = (kind + level * 256)[is_whole], rays.centers_px(*is_whole.nonzero())
    halved_row, halved_column = fine.nonzero()
    halved = halved_row.astype(np.int64), halved_column.astype(np.int64)
    if len(halved[0]):
        # centres of the four fine tiles; their levels are interpolated between corners and rounded to the sharper one
        halved_centers, levels = rays.centers_px(*halved), log2_footprint[:-1, :-1][halved]
        corner_steps = [log2_footprint[1:, :-1][halved] - levels, log2_footprint[:-1, 1:][halved] - levels]
        for row_fraction, column_fraction in itertools.product((0.25, 0.75), repeat=2):
            level = levels + row_fraction * corner_steps[0] + column_fraction * corner_steps[1]
            level = np.where(level > FAR_LEVEL / _LEVEL_STEP, np.round(level), np.floor(level)).astype(int)
            codes = np.append(codes, kind[halved] + 64 + level * 256)
            offset = np.array([column_fraction - 0.5, row_fraction - 0.5], np.float32) * np.float32(size)
            centers = np.concatenate([centers, halved_centers + offset])
    return ScreenTiles(
        size,
        (size * columns, size * rows),
        {_decode_kind(k): centers[codes == k] for k in map(int, np.unique(codes))},
        rays.centers_px(*(~(touched & (smooth | fine))).nonzero()),
        bool(np.min(sun) < _MOONLIT_MU),
        halved,
    )


def _covered_tiles(shape: tuple[int, int], size_px: int, target_px: FloatArray | None) -> BoolArray:
    """Return a mask of the tiles that the target may cover; ``target_px`` as in `earth_tiles`."""
    covered = np.zeros(shape, bool)
    if target_px is None:
        return covered
    # the target's tiles are no larger than these, so the tiles at its four corners cover each of them
    first_px = (target_px - (TILE_PX - 1) / 2).astype(np.int32)
    low, high = first_px // size_px, (first_px + TILE_PX - 1) // size_px
    ends = (low,) if np.array_equal(low, high) else (low, high)
    for column, row in itertools.product(ends, ends):
        covered[np.minimum(row[:, 1], shape[0] - 1), np.minimum(column[:, 0], shape[1] - 1)] = True
    return covered


def _decode_kind(code: int) -> TileKind:
    return TileKind(
        smooth=bool(code & 4),
        covered=bool(code & 2),
        night=bool(code & 1),
        unlit=bool(code & 128),
        icy=bool(code & 8),
        bright_water=bool(code & 16),
        level=(code >> 8) * _LEVEL_STEP,
        air=bool(code & 32),
        fine=bool(code & 64),
    )


def _all_corners(values: BoolArray) -> BoolArray:
    return values[:-1, :-1] & values[:-1, 1:] & values[1:, :-1] & values[1:, 1:]
