"""The Earth in tiles that are smooth enough: light and air at their corners, one level of detail, packed by quads.

Worth 860 ms of 800: without it the eight scenes take twice as long. Of those: one level of the detail 21, one of
magnified maps 22, the air at every other corner (`AirPass.corners`) 17.
"""

from __future__ import annotations

import math
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.earth.earth_pass import (
    DETAIL_TEXEL_KM,
    LOG2_TEXEL_KM,
    EarthDraw,
    EarthFrame,
    EarthPass,
)
from flyaround.simulator.render.gl.mipmaps import level_textures

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.earth.screen_tiles import ScreenTiles, TileKind
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.render.globe.air_pass import AirPass
    from flyaround.simulator.runtime.arrays import Float32Array, IntArray
    from flyaround.simulator.scene.illumination.bands import Bands


class CornerAir:
    """The air in front of the ground at the corners of smooth tiles.

    Parameters
    ----------
    whole, fine : of all tiles' corners (N, M, V) as of `AirPass.corners`, and of the fine ones' (9 P, V) as of
        `AirPass.at`.
    """

    def __init__(self, tiles: ScreenTiles, whole: Float32Array, fine: Float32Array) -> None:
        self._tiles, self._whole, self._fine = tiles, whole, fine

    @staticmethod
    def of(tiles: ScreenTiles, air: AirPass) -> CornerAir | None:
        """What the air pass gives at the tiles' corners; `None` where no tile is smooth."""
        if tiles.smooth_share <= 0:
            return None
        all_ground = not len(tiles.others_px) and not len(tiles.halved[0])
        whole = air.corners(*tiles.corners_px, all_ground=all_ground)
        return CornerAir(tiles, whole, air.at(tiles.fine_corners_px.reshape(-1, 2)))

    def around(self, centers_px: Float32Array, *, fine: bool) -> Float32Array:
        """(K, 4 V) of tiles, by their middles: upper left, upper right, lower left, lower right."""
        if not fine:
            return self._four(self._whole, self._tiles.place(centers_px))
        which, row, column = self._tiles.fine_place(centers_px)
        return self._four(self._fine.reshape(-1, 3, 3, self._fine.shape[1]), (row, column), which)

    @staticmethod
    def _four(
        air: Float32Array, place: tuple[IntArray, IntArray], which: IntArray | None = None
    ) -> Float32Array:
        first = () if which is None else (which,)
        at = [air[(*first, place[0] + down, place[1] + right)] for down in (0, 1) for right in (0, 1)]
        return np.stack(at, axis=-1).reshape(len(place[0]), -1)


class SmoothEarthPass(EarthPass):
    """Draws tiles by kind, and takes smooth ones from what their corners see; parameters as of `EarthPass`."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: ProgramLibrary,
        bands: Bands,
        prefetched: EarthMaps,
        *,
        precompiles: bool = False,
    ) -> None:
        super().__init__(context, programs, bands, prefetched, precompiles=precompiles)
        self._details = level_textures(context, self._detail_levels)

    def release(self) -> None:
        """Free maps, tables and vertices; the programs are the library's."""
        super().release()
        for texture in self._details:
            texture.release()

    def run_smooth(self, frame: EarthFrame, corner_air: CornerAir | None, *, quads: bool) -> None:
        """Add the Earth's light to the images.

        Parameters
        ----------
        corner_air : ``None`` without air, and where no tile is smooth.
        quads : draw smooth tiles four pixels to a texel, and not into the image itself; those that the target may
            cover are added to what is there.
        """
        groups: dict[EarthDraw, list[tuple[TileKind, Float32Array]]] = {}
        # what goes into one image comes together, and kinds that differ in nothing that is drawn too: a driver that
        # changes images finishes the first
        for kind, centers in sorted(frame.tiles.centers_px.items(), key=itemgetter(0)):
            draw = self._smooth_draw(frame, kind, quads=quads and kind.smooth)
            groups.setdefault(draw, []).append((kind, centers))
        self._run(frame, ((draw, partial(_vertices, tiles, corner_air)) for draw, tiles in groups.items()))

    def _smooth_draw(self, frame: EarthFrame, kind: TileKind, *, quads: bool) -> EarthDraw:
        images, quality = frame.images, frame.scene.quality
        width, height = frame.tiles.extent_px
        # larger than life the maps have one level; a driver that need not ask is quicker
        magnified = quality != "high" and kind.smooth and kind.level <= LOG2_TEXEL_KM
        return EarthDraw(
            self._program(frame, kind, quads=quads),
            images.quad_framebuffer if quads else images.sky_framebuffer,
            (0, 0, width // 2, height // 2) if quads else (0, 0, width, height),
            kind.covered and not quads,
            frame.tiles.size_of(kind),
            self._detail_of(kind, quality),
            None if magnified else kind.level,
        )

    def _detail_of(self, kind: TileKind, quality: str) -> moderngl.Texture:
        """The detail with all its levels, or the one level that a smooth tile needs: the driver then has no choice.

        Half of a trilinear look-up's cost is its second level, which the eye of the default preset does not miss.
        """
        level = kind.level - math.log2(DETAIL_TEXEL_KM)
        if kind.smooth and quality != "high":
            return self._details[min(max(round(level), 0), len(self._details) - 1)]
        two = quality == "high"
        return self._mipmapped_detail(
            self._context.LINEAR_MIPMAP_LINEAR if two else self._context.LINEAR_MIPMAP_NEAREST
        )


def _vertices(tiles: list[tuple[TileKind, Float32Array]], corner_air: CornerAir | None) -> Float32Array:
    """(K, 2 + 4 V) middles of the tiles of one draw call, and the air at their corners where they are smooth."""
    middles = np.concatenate([centers for _, centers in tiles])
    kind = tiles[0][0]
    if corner_air is None or not kind.smooth:
        return middles
    return np.concatenate([middles, corner_air.around(middles, fine=kind.fine)], axis=1)
