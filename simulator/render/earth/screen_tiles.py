"""Square tiles of the image that the Earth and its air touch, grouped by kind."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.frame_graph import Resource
from flyaround.simulator.render.projection import PixelRect

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray
    from flyaround.simulator.scene.state import SceneState

TILE_RAD = 0.0107
"""Angular side of a tile [rad], 32 px of a SPEED camera. Ground points interpolated between its corners are exact to a
tenth of a pixel."""
_MIN_TILE_PX, _MAX_TILE_PX = 8, 32
"""Smallest and largest tile: smaller ones cost more than drawing their pixels one by one saves, larger ones bend."""
ICE_SINE = 0.73
"""Sine of 47 degrees latitude, equatorward of which the sea is open."""


@dataclass(frozen=True, order=True)
class TileKind:
    """Properties that the tiles of one draw call share.

    Parameters
    ----------
    air : bool
        True if the tiles show only air, no ground.
    fine : bool
        True if the tiles are half as wide as others, towards the limb; only for smooth tiles.
    smooth : bool
        True if the tiles show only ground, away from limb and poles, so that light may be interpolated.
    covered : bool
        True if the target may be in front.
    night : bool
        True if city lights may be on.
    unlit : bool
        True if neither Sun nor Moon shines; only for smooth tiles.
    icy : bool
        True if sea ice may be near.
    bright_water : bool
        True if shallow or turbid water is near.
    level : float
        log2 of a pixel's footprint [km]; only for smooth tiles.
    """

    air: bool
    fine: bool
    smooth: bool
    covered: bool
    night: bool
    unlit: bool
    icy: bool
    bright_water: bool
    level: float


@dataclass(frozen=True, eq=False)
class ScreenTiles:
    """The tiles to draw, squares of whole pixels.

    Parameters
    ----------
    size_px : int
        Side of a tile.
    extent_px : tuple of int
        Width and height of all tiles together, from the image's corner to beyond its end.
    centers_px : dict
        (K, 2) float32 centres of each kind's tiles [px].
    rough_centers_px : (L, 2) array
        Centres of all the image's tiles that are not smooth [px].
    dark : bool
        True if on some ground in view moonlight may be as strong as sunlight.
    halved : tuple of array
        Rows (P,) and columns (P,) of the tiles that are drawn as 2 x 2 fine ones, counted in tiles.
    """

    size_px: int
    extent_px: tuple[int, int]
    centers_px: dict[TileKind, Float32Array]
    rough_centers_px: Float32Array
    dark: bool
    halved: tuple[IntArray, IntArray]

    def tile_side_px(self, kind: TileKind) -> float:
        """Return the side of a kind's tiles [px]."""
        return self.size_px / 2 if kind.fine else float(self.size_px)

    @property
    def smooth_share(self) -> float:
        """Share of the image's tiles that are smooth."""
        width, height = self.extent_px
        return 1 - len(self.rough_centers_px) * self.size_px**2 / (width * height)

    @property
    def all_smooth(self) -> bool:
        """True if every tile of the Earth is smooth."""
        return all(kind.smooth for kind in self.centers_px)

    @property
    def corners_px(self) -> tuple[FloatArray, FloatArray]:
        """(M,) columns and (N,) rows of the corners of all the image's tiles."""
        width, height = self.extent_px
        return tile_edges(width, self.size_px), tile_edges(height, self.size_px)

    @property
    def fine_corners_px(self) -> Float32Array:
        """(P, 3, 3, 2) corners of the fine tiles in each halved tile, row by row."""
        row, column = self.halved
        steps = np.arange(3, dtype=np.float32) * np.float32(self.size_px / 2) - np.float32(0.5)
        x = column[:, None, None] * self.size_px + steps[None, None, :]
        y = row[:, None, None] * self.size_px + steps[None, :, None]
        return np.stack(np.broadcast_arrays(x, y), axis=-1).astype(np.float32)

    def fine_tile_indices(self, centers_px: Float32Array) -> tuple[IntArray, IntArray, IntArray]:
        """Return index in ``halved`` (K,), row (K,) and column (K,) of fine tiles with centres (K, 2)."""
        half_column, half_row = (
            ((centers_px + np.float32(0.5)) / np.float32(self.size_px / 2)).astype(np.int64).T
        )
        return self._halved_index[half_row // 2, half_column // 2], half_row % 2, half_column % 2

    @cached_property
    def _halved_index(self) -> IntArray:
        """Index in ``halved`` of each of the image's tiles, row by row; 0 for tiles that are not halved."""
        width, height = self.extent_px
        index = np.zeros((height // self.size_px, width // self.size_px), np.int64)
        index[self.halved] = np.arange(len(self.halved[0]))
        return index

    def tile_indices(self, centers_px: Float32Array) -> tuple[IntArray, IntArray]:
        """Return rows (K,) and columns (K,), counted in tiles, of tiles with centres (K, 2)."""
        column, row = ((centers_px + np.float32(0.5)) / np.float32(self.size_px)).astype(np.int64).T
        return row, column

    def bounds(self, *, covered: bool) -> PixelRect | None:
        """Return the bounding rectangle of all tiles, or of those that the target may cover; None without tiles."""
        areas = [
            (self.tile_side_px(kind), centers)
            for kind, centers in self.centers_px.items()
            if len(centers) and kind.covered >= covered
        ]
        if not areas:
            return None
        low = np.min([centers.min(axis=0) + 0.5 - side / 2 for side, centers in areas], axis=0)
        high = np.max([centers.max(axis=0) + 0.5 + side / 2 for side, centers in areas], axis=0)
        return PixelRect(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


EARTH_TILES: Resource[ScreenTiles] = Resource("earth tiles")


def ice_day(scene: SceneState) -> str:
    """Return the day (ISO 8601) whose sea ice is drawn: the scene's, or the maps' without seasons."""
    return scene.epoch_utc[:10] if scene.environment.seasons else "2004-08-15"


def tile_size_px(camera: Camera) -> int:
    """Return the side of the tiles that a camera's image is divided into, from its top left corner [px]."""
    # a multiple of four: derivatives are differences between 2 x 2 texels of 2 x 2 pixels
    return min(max(4 * round(TILE_RAD / camera.pixel_angle_rad() / 4), _MIN_TILE_PX), _MAX_TILE_PX)


def uniform_tiles(earth: GlobeView, camera: Camera) -> ScreenTiles:
    """Return the tiles that Earth and air may touch as one kind, with all features enabled."""
    size, rect = tile_size_px(camera), earth.rect
    columns, rows = -(-camera.width_px // size), -(-camera.height_px // size)
    radius = float(np.linalg.norm(earth.camera))
    # highest latitude in view, plus a degree
    latitude = abs(np.arcsin(earth.camera[2] / radius)) + np.arccos(1 / max(radius, 1.0)) + np.radians(1.0)
    kind = TileKind(
        air=False,
        fine=False,
        smooth=False,
        covered=True,
        night=True,
        unlit=False,
        icy=bool(np.sin(min(latitude, np.pi / 2)) > ICE_SINE),
        bright_water=True,
        level=0.0,
    )
    all_centers = _tile_centers(0, 0, columns, rows, size)
    no_tiles = np.zeros(0, np.int64)
    touched = (
        all_centers[:0]
        if rect is None
        else _tile_centers(rect.x0 // size, rect.y0 // size, -(-rect.x1 // size), -(-rect.y1 // size), size)
    )
    return ScreenTiles(
        size, (size * columns, size * rows), {kind: touched}, all_centers, True, (no_tiles, no_tiles)
    )


@lru_cache(maxsize=8)
def _tile_centers(x0: int, y0: int, x1: int, y1: int, size: int) -> Float32Array:
    """Return (K, 2) centres [px] of the tiles in columns ``x0`` to ``x1`` and rows ``y0`` to ``y1`` (exclusive)."""
    column, row = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
    middles = np.stack([column.ravel(), row.ravel()], axis=1).astype(np.float32)
    return (middles + np.float32(0.5)) * np.float32(size) - np.float32(0.5)


def tile_edges(length_px: int, size: int) -> FloatArray:
    """Return the tiles' edges along one side; the last lies at the image's end or beyond."""
    return np.asarray(np.arange(-(-length_px // size) + 1) * float(size) - 0.5)
