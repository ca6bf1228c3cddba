"""The Earth drawn in smooth tiles: light and air interpolated from the corners, one mipmap level, packed pixels.

`python -m tools.studies.savings` measures what each of these saves on a software driver.
"""

from __future__ import annotations

import math
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.earth.earth_pass import (
    DETAIL_TEXEL_KM,
    EARTH,
    LOG2_TEXEL_KM,
    EarthDraw,
    EarthFrame,
    EarthPass,
)
from flyaround.simulator.render.earth.earth_view import EarthAirPass
from flyaround.simulator.render.earth.screen_tiles import EARTH_TILES
from flyaround.simulator.render.frame_graph import Resource
from flyaround.simulator.render.globe.frame_air import AIR_TABLES
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.moon.moon_view import MOON
from flyaround.simulator.render.software.quad_packing import QUADS, should_pack
from flyaround.simulator.render.view import SCENE

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.earth.earth_pass import Earth
    from flyaround.simulator.render.earth.screen_tiles import ScreenTiles, TileKind
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.mipmaps import TilingTexture
    from flyaround.simulator.render.globe.frame_air import FrameAir
    from flyaround.simulator.runtime.arrays import Float32Array, IntArray


_CORNERS = (0, 0), (0, 1), (1, 0), (1, 1)  # upper left, upper right, lower left, lower right


class CornerAir:
    """The air in front of the ground at the corners of smooth tiles.

    Parameters
    ----------
    tiles : ScreenTiles
        Tiles of the frame.
    coarse : (N, M, V) array
        Values at the corners of all tiles, from `FrameAir.corners`.
    fine : (9 P, V) array
        Values at the corners of the fine tiles, from `FrameAir.at_points`.
    """

    def __init__(self, tiles: ScreenTiles, coarse: Float32Array, fine: Float32Array) -> None:
        self._tiles, self._coarse, self._fine = tiles, coarse, fine

    @staticmethod
    def compute(tiles: ScreenTiles, air: FrameAir) -> CornerAir | None:
        """Compute the air at the tiles' corners; `None` if no tile is smooth."""
        if tiles.smooth_share <= 0:
            return None
        all_ground = not len(tiles.rough_centers_px) and not len(tiles.halved[0])
        coarse = air.corners(*tiles.corners_px, all_ground=all_ground)
        return CornerAir(tiles, coarse, air.at_points(tiles.fine_corners_px.reshape(-1, 2)))

    def tile_values(self, centers_px: Float32Array, *, fine: bool) -> Float32Array:
        """Return values (K, 4 V) of tiles with centres (K, 2): upper left, upper right, lower left, lower right."""
        if not fine:
            return self._corner_values(self._coarse, self._tiles.tile_indices(centers_px))
        halved_index, row, column = self._tiles.fine_tile_indices(centers_px)
        return self._corner_values(
            self._fine.reshape(-1, 3, 3, self._fine.shape[1]), (row, column), halved_index
        )

    @staticmethod
    def _corner_values(
        air: Float32Array, indices: tuple[IntArray, IntArray], halved_index: IntArray | None = None
    ) -> Float32Array:
        leading = () if halved_index is None else (halved_index,)
        row, column = indices
        values = np.empty((len(row), air.shape[-1], 4), np.float32)
        for corner, (down, right) in enumerate(_CORNERS):
            values[:, :, corner] = air[(*leading, row + down, column + right)]
        return values.reshape(len(row), -1)


CORNER_AIR: Resource[CornerAir] = Resource("corner air")


class CornerAirPass(EarthAirPass):
    """Draws this frame's air tables if any pixel reads them, and computes the air at smooth tiles' corners."""

    optional = (MOON,)
    writes = (AIR_TABLES, CORNER_AIR)

    def run(self, r: PassResources) -> None:
        """Fill the tables and the corners."""
        tiles, moon = r[EARTH_TILES], r.find(MOON)
        # if all ground is smooth, only the air at the tiles' corners is read
        corners_suffice = tiles.all_smooth and r[GLOBE].sky_rows is None
        if not corners_suffice or (moon is not None and moon.in_front):
            super().run(r)
        r[CORNER_AIR] = CornerAir.compute(tiles, r[EARTH].air(r[SCENE].environment).frame)


class SmoothEarthPass(EarthPass):
    """Draws tiles by kind, smooth ones interpolated from their corners and, if many, packed four pixels per texel."""

    optional = (*EarthPass.optional, CORNER_AIR)
    writes = (*EarthPass.writes, QUADS)

    def run(self, r: PassResources) -> None:
        """Draw packed tiles into their own framebuffer, and the others into the image."""
        frame, corner_air = EarthFrame.from_resources(r), r.find(CORNER_AIR)
        quads = should_pack(frame.images, frame.tiles) and not frame.moon_in_front
        groups: dict[EarthDraw, list[tuple[TileKind, Float32Array]]] = {}
        # Sorted, so that draws into one framebuffer are consecutive, as are kinds with the same program: the driver
        # finishes drawing when the framebuffer changes.
        for kind, centers in sorted(frame.tiles.centers_px.items(), key=itemgetter(0)):
            draw = self._smooth_draw(r[EARTH], frame, kind, quads=quads and kind.smooth)
            groups.setdefault(draw, []).append((kind, centers))
        r[EARTH].draw(
            frame, ((draw, partial(_vertices, tiles, corner_air)) for draw, tiles in groups.items())
        )
        r[QUADS] = quads or None

    def _smooth_draw(self, earth: Earth, frame: EarthFrame, kind: TileKind, *, quads: bool) -> EarthDraw:
        images, quality = frame.images, frame.scene.quality
        width, height = frame.tiles.extent_px
        # magnified maps use one level, and a driver samples faster if it has no level to select
        magnified = quality != "high" and kind.smooth and kind.level <= LOG2_TEXEL_KM
        return EarthDraw(
            earth.program(frame, kind, quads=quads),
            images.quad_framebuffer if quads else images.sky_framebuffer,
            (0, 0, width // 2, height // 2) if quads else (0, 0, width, height),
            kind.covered and not quads,
            frame.tiles.tile_side_px(kind),
            self._texture_at_level(earth.night if kind.unlit else earth.detail, kind, quality),
            self._texture_at_level(earth.night, kind, quality) if kind.night else None,
            None if magnified else kind.level,
        )

    def _texture_at_level(self, texture: TilingTexture, kind: TileKind, quality: str) -> moderngl.Texture:
        """Return the single level that a smooth tile needs, which samples faster, or the texture with all its levels.

        Only `high` interpolates between two levels, which doubles the cost of a look-up.
        """
        if kind.smooth and quality != "high":
            return texture.single(kind.level - math.log2(DETAIL_TEXEL_KM))
        trilinear = quality == "high"
        return texture.mipmapped(
            self._context.LINEAR_MIPMAP_LINEAR if trilinear else self._context.LINEAR_MIPMAP_NEAREST
        )


def _vertices(tiles: list[tuple[TileKind, Float32Array]], corner_air: CornerAir | None) -> Float32Array:
    """Return vertices (K, 2 + 4 V) of one draw call: centres of tiles, and the air at the corners of smooth ones."""
    all_centers = np.concatenate([centers for _, centers in tiles])
    kind = tiles[0][0]
    if corner_air is None or not kind.smooth:
        return all_centers
    return np.concatenate([all_centers, corner_air.tile_values(all_centers, fine=kind.fine)], axis=1)
