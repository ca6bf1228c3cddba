"""Globe pass: draws ground and air of a body that has an albedo map but no passes of its own, such as Mars."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.celestial.air_tables import GROUND_MU_MIN, GROUND_SAMPLES, air_tables
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.programs import FULL_SCREEN
from flyaround.simulator.render.globe.frame_air import (
    AIR,
    AIR_SAMPLERS,
    AIR_TABLES,
    TABLE_DEFINES,
    Air,
    FrameAir,
)
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.scene.illumination.irradiance import albedo_of

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.world.ephemeris.body import Body


class PlainGlobe:
    """Albedo map and air of a body without passes of its own, on the GPU, for one set of bands."""

    def __init__(self, device: Device, body: Body, bands: Bands) -> None:
        context, self.bands = device.context, 1 if bands == "mono" else 3
        tables = air_tables(bands, body=body)
        self.air = Air(tables, FrameAir(context, device.programs, self.bands, tables))
        albedo = albedo_of(body)
        self.albedo = context.texture(albedo.shape[::-1], 1, albedo.tobytes(), dtype="f4", alignment=1)
        self.albedo.build_mipmaps()
        self.albedo.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self.albedo.repeat_x, self.albedo.repeat_y = True, False
        device.check(f"uploading the map of {body.title}")

    def release(self) -> None:
        """Free map and tables."""
        self.air.frame.release()
        self.albedo.release()


PLAIN_GLOBE: Resource[PlainGlobe] = Resource("plain globe")
"""The plain globe, if the scene's body is not the Earth."""


class GlobeAirPass(Pass):
    """Computes this frame's tables of the air of a plain globe."""

    name = "globe.air"
    reads = (SCENE, PLAIN_GLOBE, GLOBE, AIR)
    writes = (AIR_TABLES,)

    def run(self, r: PassResources) -> None:
        """Compute the tables."""
        air = r[PLAIN_GLOBE].air.frame
        air.run(r[GLOBE])
        r[AIR_TABLES] = air.tables


class GlobePass(Pass):
    """Adds ground and air of a plain globe."""

    name = "globe.surface"
    reads = (PLAIN_GLOBE, GLOBE, *IMAGES)
    optional = (AIR_TABLES,)
    writes = (RADIANCE,)

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(self, r: PassResources) -> None:
        """Draw the pixels that the globe can touch."""
        globe, rect, images, air = r[PLAIN_GLOBE], r[GLOBE].rect, r[RADIANCE], r.find(AIR_TABLES)
        if rect is None:
            return
        defines = {
            "BANDS": globe.bands,
            "AIR": int(air is not None),
            "SMOOTH": 0,
            "MOONLIT": 0,
            "GROUND_MU_MIN": GROUND_MU_MIN,
            "GROUND_SAMPLES": GROUND_SAMPLES,
            **TABLE_DEFINES,
        }
        samplers = AIR_SAMPLERS[globe.bands] if air is not None else ()
        ground = ("t_ground",) if air is not None and globe.bands > 1 else ()
        program = self._programs.get(
            FULL_SCREEN, "globe/globe.frag", defines, ("t_coverage", "t_albedo", *samplers, *ground)
        )
        images.mark_drawn(rect)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = rect.viewport
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        textures = {"t_coverage": images.coverage, "t_albedo": globe.albedo}
        textures |= dict(zip(samplers, air or (), strict=True))
        textures |= dict.fromkeys(ground, globe.air.frame.ground)
        program.bind_textures(**textures)
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(program.gl, [])
        self._arrays[program].render(vertices=3)

    def release(self) -> None:
        """Free the vertex arrays; the programs belong to the library."""
        for array in self._arrays.values():
            array.release()
