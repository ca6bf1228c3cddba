"""The Earth in smooth tiles: light and air at their corners, one level of detail, four pixels per texel.

Without it the eight bench scenes take 860 ms longer than 800 ms. Parts of that: one level of the detail 21 ms, one of
magnified maps 22 ms, the air at every other corner (`FrameAir.corners`) 17 ms.
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
from flyaround.simulator.render.software.quad_packing import QUADS, worth_packing
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
    whole : (N, M, V) array
        Values at the corners of all tiles, from `FrameAir.corners`.
    fine : (9 P, V) array
        Values at the corners of the fine tiles, from `FrameAir.at`.
    """

    def __init__(self, tiles: ScreenTiles, whole: Float32Array, fine: Float32Array) -> None:
        self._tiles, self._whole, self._fine = tiles, whole, fine

    @staticmethod
    def of(tiles: ScreenTiles, air: FrameAir) -> CornerAir | None:
        """Return the air pass's light at the tiles' corners; `None` if no tile is smooth."""
        if tiles.smooth_share <= 0:
            return None
        all_ground = not len(tiles.others_px) and not len(tiles.halved[0])
        whole = air.corners(*tiles.corners_px, all_ground=all_ground)
        return CornerAir(tiles, whole, air.at(tiles.fine_corners_px.reshape(-1, 2)))

    def around(self, centers_px: Float32Array, *, fine: bool) -> Float32Array:
        """Return (K, 4 V) values of tiles, by their centres: upper left, upper right, lower left, lower right."""
        if not fine:
            return self._four(self._whole, self._tiles.place(centers_px))
        which, row, column = self._tiles.fine_place(centers_px)
        return self._four(self._fine.reshape(-1, 3, 3, self._fine.shape[1]), (row, column), which)

    @staticmethod
    def _four(
        air: Float32Array, place: tuple[IntArray, IntArray], which: IntArray | None = None
    ) -> Float32Array:
        first = () if which is None else (which,)
        row, column = place
        four = np.empty((len(row), air.shape[-1], 4), np.float32)
        for corner, (down, right) in enumerate(_CORNERS):
            four[:, :, corner] = air[(*first, row + down, column + right)]
        return four.reshape(len(row), -1)


CORNER_AIR: Resource[CornerAir] = Resource("corner air")


class CornerAirPass(EarthAirPass):
    """Draws this frame's air tables if any pixel reads them, and computes the air at smooth tiles' corners."""

    optional = (MOON,)
    writes = (AIR_TABLES, CORNER_AIR)

    def run(self, r: PassResources) -> None:
        """Fill the tables and the corners."""
        tiles, moon = r[EARTH_TILES], r.find(MOON)
        # a view with smooth ground only reads the air at its tiles' corners
        corners_do = tiles.all_smooth and r[GLOBE].sky_rows is None
        if not corners_do or (moon is not None and moon.in_front):
            super().run(r)
        r[CORNER_AIR] = CornerAir.of(tiles, r[EARTH].air(r[SCENE].environment).frame)


class SmoothEarthPass(EarthPass):
    """Draws tiles by kind, smooth ones interpolated from their corners and, if many, packed four pixels per texel."""

    optional = (*EarthPass.optional, CORNER_AIR)
    writes = (*EarthPass.writes, QUADS)

    def run(self, r: PassResources) -> None:
        """Draw packed tiles to their own framebuffer; covered ones are added to the image."""
        frame, corner_air = EarthFrame.of(r), r.find(CORNER_AIR)
        quads = worth_packing(frame.images, frame.tiles) and not frame.moon_in_front
        groups: dict[EarthDraw, list[tuple[TileKind, Float32Array]]] = {}
        # draws to one image are consecutive, and so are kinds with the same program: changing the image makes a driver
        # finish it
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
        # magnified maps have one level, and a driver is faster if it has no level to select
        magnified = quality != "high" and kind.smooth and kind.level <= LOG2_TEXEL_KM
        return EarthDraw(
            earth.program(frame, kind, quads=quads),
            images.quad_framebuffer if quads else images.sky_framebuffer,
            (0, 0, width // 2, height // 2) if quads else (0, 0, width, height),
            kind.covered and not quads,
            frame.tiles.size_of(kind),
            self._level_of(earth.night if kind.unlit else earth.detail, kind, quality),
            self._level_of(earth.night, kind, quality) if kind.night else None,
            None if magnified else kind.level,
        )

    def _level_of(self, texture: TilingTexture, kind: TileKind, quality: str) -> moderngl.Texture:
        """Return a texture with all its levels, or with the one level that a smooth tile needs, which is faster.

        Half of a trilinear look-up's cost is its second level, which the default preset does without.
        """
        if kind.smooth and quality != "high":
            return texture.single(kind.level - math.log2(DETAIL_TEXEL_KM))
        two = quality == "high"
        return texture.mipmapped(
            self._context.LINEAR_MIPMAP_LINEAR if two else self._context.LINEAR_MIPMAP_NEAREST
        )


def _vertices(tiles: list[tuple[TileKind, Float32Array]], corner_air: CornerAir | None) -> Float32Array:
    """Return (K, 2 + 4 V): centres of the tiles of one draw call, and the air at their corners if they are smooth."""
    middles = np.concatenate([centers for _, centers in tiles])
    kind = tiles[0][0]
    if corner_air is None or not kind.smooth:
        return middles
    return np.concatenate([middles, corner_air.around(middles, fine=kind.fine)], axis=1)
