"""Globe pass: ground and air of a body without passes of its own. Reads albedo and air; adds to the radiance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.programs import FULL_SCREEN
from flyaround.simulator.render.globe.air_pass import AIR_SAMPLERS, TABLE_DEFINES, Air, AirPass
from flyaround.simulator.render.globe.air_tables import GROUND_MU_MIN, GROUND_SAMPLES, air_tables
from flyaround.simulator.scene.illumination.irradiance import albedo_of

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.world.ephemeris.body import Body


class GlobePass:
    """A body for one number of bands; its map is uploaded when it is made."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, body: Body, bands: Bands) -> None:
        self._context, self._programs = context, programs
        self.bands = 1 if bands == "mono" else 3
        tables = air_tables(bands, body=body)
        self.air = Air(tables, AirPass(context, programs, self.bands, tables))
        albedo = albedo_of(body)
        self._albedo = context.texture(albedo.shape[::-1], 1, albedo.tobytes(), dtype="f4", alignment=1)
        self._albedo.build_mipmaps()
        self._albedo.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self._albedo.repeat_x, self._albedo.repeat_y = True, False
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(self, images: FrameImages, view: GlobeView, air: list[moderngl.Texture] | None) -> None:
        """Add the body's light to the images; ``air``: this frame's air tables, ``None`` without air."""
        if view.rect is None:
            return
        defines = {
            "BANDS": self.bands,
            "AIR": int(air is not None),
            "SMOOTH": 0,
            "MOONLIT": 0,
            "GROUND_MU_MIN": GROUND_MU_MIN,
            "GROUND_SAMPLES": GROUND_SAMPLES,
            **TABLE_DEFINES,
        }
        samplers = AIR_SAMPLERS[self.bands] if air is not None else ()
        ground = ("t_ground",) if air is not None and self.bands > 1 else ()
        program = self._programs.get(
            FULL_SCREEN, "globe/globe.frag", defines, ("t_coverage", "t_albedo", *samplers, *ground)
        )
        images.mark_lit(view.rect)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = view.rect.viewport
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        textures = {"t_coverage": images.coverage, "t_albedo": self._albedo}
        textures |= dict(zip(samplers, air or (), strict=True))
        textures |= dict.fromkeys(ground, self.air.frame.ground)
        program.bind_textures(**textures)
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(program.gl, [])
        self._arrays[program].render(vertices=3)

    def release(self) -> None:
        """Free map, tables and vertex arrays; the programs are the library's."""
        for array in self._arrays.values():
            array.release()
        self.air.frame.release()
        self._albedo.release()
