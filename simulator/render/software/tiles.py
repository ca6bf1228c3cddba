"""Tiles of the screen: which of them the Earth touches, and which are smooth enough to be interpolated."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.earth.ocean_colour import near_shoals
from simulator.render.earth.sea_ice import near_ice
from simulator.render.projection import PixelRect, directions
from simulator.render.software.coverage_mask import TILE_PX
from simulator.render.view import EQUATOR_M

if TYPE_CHECKING:
    from simulator.camera.lens.camera_model import Camera
    from simulator.render.earth.earth_view import EarthView
    from simulator.runtime.arrays import Float32Array, FloatArray, IntArray

TILE_RAD = (
    0.0107  # 32 pixels of a SPEED camera: the ground point bends by less than a tenth of a pixel in between
)
_SMALLEST_PX, _LARGEST_PX = 8, 32
_SMOOTH_DISC = (
    0.08  # square of the ray's depth under the sphere, 1 at the nadir: up to 73 degrees from the vertical
)
_FINE_DISC = 0.02  # of tiles half as wide, between which the ground bends as much: up to 82 degrees
_FINE_KM = 1.6  # largest footprint of a pixel in them: beyond it clouds and floes are averaged
_LARGEST_GROUND = 0.015  # of a tile on the ground [radii]: light and air are even enough over 100 km
_POLE_SINE = 0.995  # the maps' longitude bends too fast nearer to the poles
_LEVEL_STEP = 0.5  # of the levels of detail: a smooth tile has one for all its pixels
_ICE_SINE = 0.73  # of the latitude (47 degrees): the sea is open nearer to the equator
# of a tile on the ground [radii]: one degree; larger ones may hold shoals between their corners
_LARGEST_OPEN = 0.017
_MOONLIT_MU = -0.06  # of the same: there moonlight begins to count, shaders/earth/point.glsl
_NIGHT_MU = 0.03  # cosine of the Sun's zenith angle: city lights are out where it is higher


@dataclass(frozen=True, order=True)
class TileKind:
    """What the tiles of one draw call have in common.

    Parameters
    ----------
    smooth : all ground, away from limb and poles. covered : the target may be in front.
    night : some of it is dark enough for city lights. icy : some of it is near sea ice, or may be.
    shoal : some of it is near water that is shallow or turbid.
    level : log2 of a pixel's footprint [km], smooth tiles only.
    air : none of it is ground. fine : tiles half as wide as the others, nearer to the limb; smooth ones only.
    """

    air: bool
    fine: bool
    smooth: bool
    covered: bool
    night: bool
    icy: bool
    shoal: bool
    level: float


@dataclass(frozen=True, eq=False)
class ScreenTiles:
    """The tiles to draw, squares of whole pixels.

    Parameters
    ----------
    size_px : side of a tile. centers_px : (K, 2) float32 middles of each kind's tiles; pixel edges lie at .5.
    extent_px : width and height of all tiles together, from the image's corner to beyond its end.
    dark : some ground in view has no more light of the Sun than the Moon may give.
    others_px : (L, 2) of all the image's tiles but the smooth ones.
    halved : (P,) rows and columns of tiles that are drawn as two by two fine ones, counted in tiles.
    """

    size_px: int
    extent_px: tuple[int, int]
    centers_px: dict[TileKind, Float32Array]
    others_px: Float32Array
    dark: bool
    halved: tuple[IntArray, IntArray]

    def size_of(self, kind: TileKind) -> float:
        """Side of a kind's tiles [px]."""
        return self.size_px / 2 if kind.fine else float(self.size_px)

    @property
    def smooth_share(self) -> float:
        """Share of the image's tiles that are smooth."""
        width, height = self.extent_px
        return 1 - len(self.others_px) * self.size_px**2 / (width * height)

    @property
    def all_smooth(self) -> bool:
        """Whether the Earth's tiles are smooth, every one."""
        return all(kind.smooth for kind in self.centers_px)

    @property
    def corners_px(self) -> tuple[FloatArray, FloatArray]:
        """(M,) columns and (N,) rows of the corners of all the image's tiles."""
        width, height = self.extent_px
        return _edges(width, self.size_px), _edges(height, self.size_px)

    @property
    def fine_corners_px(self) -> Float32Array:
        """(P, 3, 3, 2) corners of the fine tiles in each of the halved ones, row by row."""
        row, column = self.halved
        steps = np.arange(3, dtype=np.float32) * np.float32(self.size_px / 2) - np.float32(0.5)
        x = column[:, None, None] * self.size_px + steps[None, None, :]
        y = row[:, None, None] * self.size_px + steps[None, :, None]
        return np.stack(np.broadcast_arrays(x, y), axis=-1).astype(np.float32)

    def fine_place(self, centers_px: Float32Array) -> tuple[IntArray, IntArray, IntArray]:
        """(K,) of fine tiles, by their middles (K, 2): which of ``halved`` holds them, row and column in it."""
        shape = tuple(side // self.size_px for side in reversed(self.extent_px))
        which = np.zeros(shape, np.int64)
        which[self.halved] = np.arange(len(self.halved[0]))
        half_column, half_row = (
            ((centers_px + np.float32(0.5)) / np.float32(self.size_px / 2)).astype(np.int64).T
        )
        return which[half_row // 2, half_column // 2], half_row % 2, half_column % 2

    def place(self, centers_px: Float32Array) -> tuple[IntArray, IntArray]:
        """(K,) rows and columns of tiles, counted in tiles, by their middles (K, 2)."""
        column, row = ((centers_px + np.float32(0.5)) / np.float32(self.size_px)).astype(np.int64).T
        return row, column

    def covered(self) -> PixelRect | None:
        """Pixels that hold the tiles that the target may be in front of."""
        found = [(self.size_of(kind), at) for kind, at in self.centers_px.items() if kind.covered]
        if not found:
            return None
        low = np.min([at.min(axis=0) + 0.5 - size / 2 for size, at in found], axis=0)
        high = np.max([at.max(axis=0) + 0.5 + size / 2 for size, at in found], axis=0)
        return PixelRect(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def tile_size_px(camera: Camera) -> int:
    """Side of the tiles that a camera's image is cut into, from its top left corner [px]."""
    # a multiple of four: derivatives are taken between neighbours of two by two texels of two by two pixels
    return min(max(4 * round(TILE_RAD / camera.pixel_angle_rad() / 4), _SMALLEST_PX), _LARGEST_PX)


def earth_tiles(earth: EarthView, camera: Camera, target_px: FloatArray | None, day: str) -> ScreenTiles:
    """Cut the image into tiles and sort them.

    Parameters
    ----------
    target_px : (K, 2) centres of the tiles (`cover`) that the target may touch, ``None`` without target.
    day : ISO 8601, whose sea ice is drawn.
    """
    pixel_rad, size = camera.pixel_angle_rad(), tile_size_px(camera)
    bent = not camera.distortion.is_none
    x, y = _edges(camera.width_px, size), _edges(camera.height_px, size)
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
    no_ice = (np.abs(ground[2]) + span < _ICE_SINE) | (~near_ice(ground[2], longitude, day) & narrow)
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


def uniform_tiles(earth: EarthView, camera: Camera) -> ScreenTiles:
    """The tiles that Earth and air may touch as one kind, which any pixel may be: nothing is worked out of them."""
    size, rect = tile_size_px(camera), earth.rect
    columns, rows = -(-camera.width_px // size), -(-camera.height_px // size)
    radius = float(np.linalg.norm(earth.camera))
    # the farthest from the equator that is in view, and a degree
    latitude = abs(np.arcsin(earth.camera[2] / radius)) + np.arccos(1 / max(radius, 1.0)) + np.radians(1.0)
    kind = TileKind(
        air=False,
        fine=False,
        smooth=False,
        covered=True,
        night=True,
        icy=bool(np.sin(min(latitude, np.pi / 2)) > _ICE_SINE),
        shoal=True,
        level=0.0,
    )
    every = _middles(0, 0, columns, rows, size)
    none = np.zeros(0, np.int64)
    touched = (
        every[:0]
        if rect is None
        else _middles(rect.x0 // size, rect.y0 // size, -(-rect.x1 // size), -(-rect.y1 // size), size)
    )
    return ScreenTiles(size, (size * columns, size * rows), {kind: touched}, every, True, (none, none))


@lru_cache(maxsize=8)
def _middles(x0: int, y0: int, x1: int, y1: int, size: int) -> Float32Array:
    """(K, 2) middles [px] of the tiles from column ``x0`` and row ``y0`` to before ``x1`` and ``y1``."""
    column, row = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
    middles = np.stack([column.ravel(), row.ravel()], axis=1).astype(np.float32)
    return (middles + np.float32(0.5)) * np.float32(size) - np.float32(0.5)


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


def _edges(length_px: int, size: int) -> FloatArray:
    """Edges of the tiles along one side; the last lies at the image's end or beyond."""
    return np.asarray(np.arange(-(-length_px // size) + 1) * float(size) - 0.5)


def _all_corners(values: np.typing.NDArray[np.bool_]) -> np.typing.NDArray[np.bool_]:
    return values[:-1, :-1] & values[:-1, 1:] & values[1:, :-1] & values[1:, 1:]
