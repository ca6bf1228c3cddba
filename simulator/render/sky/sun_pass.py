"""Sun pass: the disc with its limb darkening, where it is in the image. Adds to the radiance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.programs import FULL_SCREEN
from flyaround.simulator.render.globe.air_pass import AIR_SAMPLERS, TABLE_DEFINES
from flyaround.simulator.render.moon.moon_view import disc_rect

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.render.view import View


class SunPass:
    """The disc is some 28 pixels wide in a SPEED camera, and one in a wide one: its edge is shared by coverage."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context, self._programs = context, programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(
        self,
        images: FrameImages,
        view: View,
        camera: Camera,
        *,
        earth: bool,
        air: list[moderngl.Texture] | None,
        moon: bool,
    ) -> None:
        """Add the Sun.

        Parameters
        ----------
        earth : whether the Earth hides it. air : this frame's air table, which reddens it; ``None`` without air.
        moon : whether the Moon may hide it.
        """
        rect = sun_rect(view, camera)
        if rect is None:
            return
        defines = {
            "BANDS": images.bands,
            "GLOBE": int(earth),
            "AIR": int(air is not None),
            "MOON": int(moon),
            **TABLE_DEFINES,
        }
        program = self._programs.get(
            FULL_SCREEN, "sky/sun.frag", defines, ("t_coverage", *AIR_SAMPLERS[images.bands])
        )
        images.mark_lit(rect)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = rect.viewport
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        program.bind_textures(t_coverage=images.coverage)
        if air is not None:
            program.bind_textures(**dict(zip(AIR_SAMPLERS[images.bands], air, strict=True)))
        program.set("u_sun_disc", (*view.sun_direction, view.sun_sine))
        program.set("u_sun_full_irradiance", (*view.sun_irradiance_w_m2, *[0.0] * (4 - images.bands)))
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(program.gl, [])
        self._arrays[program].render(vertices=3)


def sun_rect(view: View, camera: Camera) -> PixelRect | None:
    """Pixels that the disc can touch, or ``None``."""
    return disc_rect(camera, view.sun_direction, view.sun_sine)
