"""Smooth shading: tiles that one flat face fills are shaded at corners. Reads samples and shadows; writes radiance.

Close up most of a craft's pixels lie in such tiles, and light changes so little from one pixel to the next that what
is between the corners of a tile can be interpolated: shaders/target/smooth_corners.frag says where.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.gl.buffer_pool import BufferPool
from simulator.render.gl.context import release
from simulator.render.gl.fences import draw_to, flush
from simulator.render.gl.programs import FULL_SCREEN
from simulator.render.software.edge_free_tiles import crossed_tiles
from simulator.render.target.sample_pattern import pattern_defines
from simulator.render.target.shade_pass import ShadePass, light_defines
from simulator.render.target.viewport_fit import TILE_PX

if TYPE_CHECKING:
    from collections.abc import Mapping

    import moderngl

    from simulator.render.gl.programs import Program, ProgramLibrary
    from simulator.render.projection import PixelRect
    from simulator.render.target.mesh import GpuMesh
    from simulator.render.target.sample_pattern import SamplePattern
    from simulator.render.target.visible_edges import EdgeCamera, VisibleEdges
    from simulator.runtime.arrays import Float32Array, FloatArray
    from simulator.targets.model import Target

LEAST_TILES = 1000
LEAST_PER_EDGE = 0.1
"""Tiles that the target touches over its mesh's edges: with fewer hardly a tile is without an edge."""
COLUMNS = 128
MOST_CRINKLED = 0.3  # of a craft's surface
LEAST_BENT = 0.1  # of a craft's surface, for tiles of bent faces to be worth a look
_BENT = 0.99985  # cosine of the angle, one degree, between a bent face's plane and its normals
_NOTHING = -1.5  # below are tiles that show nothing of the target, shaders/target/smooth_corners.frag
SAMPLERS = (*(name for name in ShadePass.SAMPLERS if name != "t_slope"), "t_tiles")
_NAMES = ("in_corners", "in_green", "in_blue")


def is_smooth(target: Target) -> bool:
    """Whether light changes slowly over most of a target's faces: on few do colour or normal differ by the pixel."""
    if any(any(material.textures) for material in target.materials):
        return False
    crinkled = {material.name for material in target.materials if material.crinkle > 0}
    area = {True: 0.0, False: 0.0}
    for part in target.parts:
        corners = part.positions_m.astype(float)[np.asarray(part.triangles)]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area[part.material in crinkled] += float(np.linalg.norm(across, axis=1).sum())
    return area[True] <= MOST_CRINKLED * sum(area.values())


def is_curved(target: Target) -> bool:
    """Whether much of a target's surface is round: its faces' normals differ from corner to corner."""
    whole = bent = 0.0
    for part in target.parts:
        corners = part.positions_m.astype(float)[np.asarray(part.triangles)]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double = np.linalg.norm(across, axis=1)
        normals = part.normals[np.asarray(part.triangles)].astype(float)
        turned = np.einsum("tkc,tc->tk", normals, across).min(axis=1) < _BENT * double
        whole, bent = whole + double.sum(), bent + double[turned].sum()
    return bool(bent > LEAST_BENT * whole)


def split_tiles(
    tiles_px: FloatArray, seen: VisibleEdges, view: EdgeCamera, edges: int
) -> tuple[FloatArray, FloatArray]:
    """Centres (K, 2) [px] of the tiles that some edge comes near, and of those that none does: of a near craft only.

    Parameters
    ----------
    tiles_px : (K, 2) of all. view : the whole mesh lies in front of its camera. edges : of the mesh, uncut.
    """
    if len(tiles_px) < max(LEAST_TILES, LEAST_PER_EDGE * edges):
        return tiles_px, tiles_px[:0]
    crossed = crossed_tiles(seen.lines_px(view), view.rect)
    column, row = ((tiles_px - [view.rect.x0, view.rect.y0]).T // TILE_PX).astype(np.intp)
    near = crossed[row, column]
    return tiles_px[near], tiles_px[~near]


@dataclass(frozen=True, eq=False)
class SmoothTiles:
    """Tiles without edges, sorted by what they show; those that show nothing are left out.

    Parameters
    ----------
    centers_px : (K, 2) of those to interpolate. corners : (K, 4 n) their radiance there, per band.
    others_px : (L, 2) of those whose pixels must be shaded.
    """

    centers_px: FloatArray
    corners: Float32Array
    others_px: FloatArray


class CornerImage:
    """The middles of tiles, a tile to a texel in rows of `COLUMNS`, and their corners' radiance, an image to a band."""

    def __init__(self, context: moderngl.Context, width: int, height: int, bands: int) -> None:
        self._context = context
        self.tiles = context.texture((width, height), 2, dtype="f4")
        self.corners = [context.texture((width, height), 4, dtype="f4") for _ in range(bands)]
        self.framebuffer = context.framebuffer(self.corners)

    def release(self) -> None:
        """Free the images."""
        release(self._context, self.framebuffer, self.tiles, *self.corners)


class SmoothShadingPass:
    """Shades the corners of tiles, and fills in what may be interpolated."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context, self._programs = context, programs
        self._images: dict[int, BufferPool[CornerImage]] = {}
        self._looks: dict[Program, moderngl.VertexArray] = {}
        self._fills: dict[Program, moderngl.VertexArray] = {}
        self._values = context.buffer(reserve=8, dynamic=True)

    def program(
        self, lattice: SamplePattern, bands: int, mesh: GpuMesh, shadow_window: int, *, curved: bool
    ) -> Program:
        """The program that shades the corners of tiles no edge comes near, of a mesh without textures.

        Parameters
        ----------
        curved : tiles of curved faces may be interpolated too.
        """
        defines = {**light_defines(bands, mesh, shadow_window), **pattern_defines(lattice)}
        if curved:
            defines["BENT"] = ""
        return self._programs.get(
            FULL_SCREEN,
            "target/smooth_corners.frag",
            {**defines, "TILE_PX": TILE_PX},
            SAMPLERS,
            many_fragments=True,
        )

    def shade_corners(
        self, tiles_px: FloatArray, program: Program, textures: Mapping[str, moderngl.Texture], bands: int
    ) -> SmoothTiles:
        """Shade tiles at their corners; waits for the driver.

        Parameters
        ----------
        tiles_px : (K, 2) centres of tiles that no edge comes near. program : of `program`.
        textures : by the names of its samplers. bands : 1 or 3.
        """
        rows = -(-len(tiles_px) // COLUMNS)
        if bands not in self._images:
            self._images[bands] = BufferPool(lambda w, h: CornerImage(self._context, w, h, bands))
        image = self._images[bands].at_least(COLUMNS, rows)
        window = (0, 0, COLUMNS, rows)
        middles = np.empty((rows * COLUMNS, 2), np.float32)
        middles[: len(tiles_px)] = tiles_px
        middles[len(tiles_px) :] = tiles_px[-1]
        image.tiles.write(middles, viewport=window)
        draw_to(image.framebuffer)
        image.framebuffer.viewport = window
        self._context.enable_only(self._context.NOTHING)
        program.bind_textures(**textures, t_tiles=image.tiles)
        columns, lines = textures["t_surface"].size
        program.set("u_texel", (1 / columns, 1 / lines))
        if program not in self._looks:
            self._looks[program] = self._context.vertex_array(program.gl, [])
        self._looks[program].render(vertices=3)
        flush(self._context)
        read = [image.framebuffer.read(window, components=4, attachment=k, dtype="f4") for k in range(bands)]
        corners = np.concatenate([np.frombuffer(band, np.float32).reshape(-1, 4) for band in read], axis=1)
        corners = corners[: len(tiles_px)]
        even = corners[:, 0] >= 0
        rest = ~even & (corners[:, 0] > _NOTHING)
        return SmoothTiles(tiles_px[even], corners[even], tiles_px[rest])

    def fill(
        self, tiles: SmoothTiles, framebuffer: moderngl.Framebuffer, rect: PixelRect, bands: int
    ) -> None:
        """Draw the tiles that may be interpolated; ``rect`` holds them all."""
        if not len(tiles.centers_px):
            return
        program = self._programs.get(
            "target/smooth_fill.vert", "target/smooth_fill.frag", {"BANDS": bands, "TILE_PX": TILE_PX}
        )
        columns, rows = (-(-side // TILE_PX) * TILE_PX for side in (rect.width, rect.height))
        window = (rect.x0, rect.y0, columns, rows)
        draw_to(framebuffer)
        framebuffer.viewport = window
        program.set("u_window", window)
        self._context.enable_only(self._context.PROGRAM_POINT_SIZE)
        vertices = np.concatenate([tiles.centers_px.astype(np.float32), tiles.corners], axis=1)
        self._values.orphan(vertices.nbytes)
        self._values.write(vertices)
        if program not in self._fills:
            content = (self._values, "2f" + " 4f" * bands, "in_pixel", *_NAMES[:bands])
            self._fills[program] = self._context.vertex_array(
                program.gl, [content], mode=self._context.POINTS
            )
        self._fills[program].render(vertices=len(vertices))
