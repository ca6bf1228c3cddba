"""Shading pass: gathers each pixel's samples, shades each distinct surface once, writes radiance and coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np

from flyaround.simulator.baking.radiance_transfer import LARGEST_SLOPE
from flyaround.simulator.render.craft.edge_pass import edge_defines
from flyaround.simulator.render.craft.gbuffer_pass import normal_bits
from flyaround.simulator.render.craft.sample_pattern import pattern_defines
from flyaround.simulator.render.craft.viewport_fit import TILE_PX
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.library import draw_one_point
from flyaround.simulator.scene.illumination.lamp import Profile

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.sample_pattern import SamplePattern
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.lamp import Lamp

# distinct (material, normal) groups shaded per pixel, with exact areas per quarter of it; the rest joins the last
MAX_SURFACES, MAX_SURFACES_EXACT = 4, 17
# a far craft has dozens in each of its few pixels: of four the last, by chance a facet that faces the Sun, stood for so
# much that pixels came out twice as bright, and flickered
MAX_SURFACES_FAR, FAR_SAMPLES = 12, 32


class ShadePass:
    """Reads g-buffer and shadow map, writes the frame's radiance (premultiplied) and the target's coverage."""

    SAMPLERS = ("t_surface", "t_depth", "t_shadow", "t_slope", "t_sky_visibility", "t_interreflection")
    TEXTURED = ("t_texel", "t_detail")
    LIT = ("t_light_depth",)

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self._programs = programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}
        self._tiles = context.buffer(reserve=8, dynamic=True)

    def program(
        self,
        lattice: SamplePattern,
        bands: int,
        mesh: GpuMesh,
        shadow_window: int,
        lamp: Lamp | None = None,
        *,
        exact: bool,
        light_points: int = 0,
    ) -> Program:
        """The program of one lattice, number of bands and kind of mesh; what its materials lack is left out.

        Parameters
        ----------
        exact : the slopes are those of `EXACT_AREAS`. light_points : patches of each area light; 0 where none is.
        """
        most = MAX_SURFACES_FAR if lattice.samples > FAR_SAMPLES else MAX_SURFACES
        defines = {
            **_light_defines(bands, mesh, shadow_window),
            **pattern_defines(lattice),
            **edge_defines(exact=exact),
            "MAX_SURFACES": MAX_SURFACES_EXACT if exact else most,
            "TILE_PX": TILE_PX,
            **({} if lamp is None else {"LAMP": 1 + get_args(Profile).index(lamp.profile)}),
            **({"LIGHT_POINTS": light_points} if light_points else {}),
        }
        return self._programs.get(
            "craft/tiles.vert",
            "craft/shade.frag",
            defines,
            self.SAMPLERS + self.TEXTURED * (mesh.uv is not None) + self.LIT * (light_points > 0),
            many_fragments=True,
        )

    def run(
        self,
        framebuffer: moderngl.Framebuffer,
        rect: PixelRect,
        tiles_px: FloatArray,
        program: Program,
        textures: dict[str, moderngl.Texture],
        *,
        one_tile: bool = False,
    ) -> None:
        """Shade the pixels of ``rect`` that the target may touch.

        Parameters
        ----------
        tiles_px : (K, 2) centres of the tiles of those pixels.
        textures : by the names of the program's samplers.
        one_tile : draw the first alone, while other threads go on: a software driver compiles the program then.
        """
        draw_to(framebuffer)
        # whole tiles, beyond the image's edge too: a point is dropped when its middle is outside
        width, height = (-(-side // TILE_PX) * TILE_PX for side in (rect.width, rect.height))
        window = (rect.x0, rect.y0, width, height)
        framebuffer.viewport = window
        self._context.enable_only(self._context.PROGRAM_POINT_SIZE)
        program.bind_textures(**textures)
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(
                program.gl, [(self._tiles, "2f", "in_pixel")], mode=self._context.POINTS
            )
        tiles = tiles_px.astype(np.float32)
        self._tiles.orphan(tiles.nbytes)
        self._tiles.write(tiles)
        program.set("u_window", window)
        for name, image in (("u_texel", "t_surface"), ("u_slope_texel", "t_slope")):
            columns, rows = textures[image].size
            program.set(name, (1 / columns, 1 / rows))
        if one_tile:
            draw_one_point(self._arrays[program])
        else:
            self._arrays[program].render(vertices=len(tiles))


def _light_defines(bands: int, mesh: GpuMesh, shadow_window: int) -> dict[str, object]:
    """Defines of a mesh's light: what its materials lack is left out."""
    switches = {
        "TEXTURED": mesh.uv is not None,
        "CRINKLE": any(m.crinkle > 0 for m in mesh.materials),
        "CLEARCOAT": any(m.clearcoat > 0 for m in mesh.materials),
        "CLOSED": mesh.is_closed,
        "BRUSHED": any(m.anisotropy > 0 for m in mesh.materials),
    }
    return {
        "BANDS": bands,
        "NORMAL_BITS": normal_bits(mesh),
        "LARGEST_SLOPE": LARGEST_SLOPE,
        **{name: "" for name, on in switches.items() if on},
        **_shadow_defines(shadow_window),
    }


def _shadow_defines(window: int) -> dict[str, object]:
    """The shadow's window of ``window`` x ``window`` texels as blocks of four, which one fetch gathers."""
    starts = [(i, j) for j in range(0, window, 2) for i in range(0, window, 2)]
    each = " ".join(f"F({k}, {i}, {j})" for k, (i, j) in enumerate(starts))
    return {"SHADOW_WINDOW": window, "FOR_EACH_SHADOW_BLOCK(F)": each}
