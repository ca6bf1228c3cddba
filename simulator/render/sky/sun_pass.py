"""Sun pass: draws the limb-darkened disc of the Sun if it is in the image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.frame_graph import Pass
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.programs import FULL_SCREEN
from flyaround.simulator.render.globe.frame_air import AIR_SAMPLERS, AIR_TABLES, TABLE_DEFINES
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.moon.moon_view import MOON, disc_rect
from flyaround.simulator.render.view import SCENE, VIEW

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.render.view import View


class SunPass(Pass):
    """Adds the Sun's disc to the radiance.

    The disc is 28 pixels wide in a SPEED camera but a single pixel in a wide-angle one, so its edge is antialiased.
    """

    name = "sun"
    reads = (SCENE, VIEW, *IMAGES)
    optional = (GLOBE, MOON, AIR_TABLES)
    writes = (RADIANCE,)

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(self, r: PassResources) -> None:
        """Draw the disc if it is in the image and not hidden by the globe."""
        images, view = r[RADIANCE], r[VIEW]
        earth, moon, air = r.find(GLOBE), r.find(MOON), r.find(AIR_TABLES)
        if (earth is not None and earth.fills_image) or not r[SCENE].environment.sun:
            return
        rect = sun_rect(view, r[SCENE].camera)
        if rect is None:
            return
        defines = {
            "BANDS": images.bands,
            "GLOBE": int(earth is not None),
            "AIR": int(air is not None),
            "MOON": int(moon is not None and moon.rect is not None),
            **TABLE_DEFINES,
        }
        program = self._programs.get(
            FULL_SCREEN, "sky/sun.frag", defines, ("t_coverage", *AIR_SAMPLERS[images.bands])
        )
        images.mark_drawn(rect)
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
    """Return the pixels that the Sun's disc may touch, or ``None`` if it is not in the image."""
    return disc_rect(camera, view.sun_direction, view.sun_sine)
