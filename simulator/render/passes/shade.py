"""Shading pass: gathers each pixel's samples, shades each distinct surface once, writes radiance and coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator.render.programs import FULL_SCREEN

if TYPE_CHECKING:
    import moderngl

    from simulator.render.lattice import Lattice
    from simulator.render.programs import Program, ProgramLibrary
    from simulator.render.projection import PixelRect

MAX_SURFACES = 4  # distinct (material, normal) groups shaded per pixel; the rest joins the last


class ShadePass:
    """Reads g-buffer and shadow map, writes the frame's radiance (premultiplied) and the target's coverage."""

    SAMPLERS = ("t_surface", "t_depth", "t_shadow")
    TEXTURED = ("t_texel", "t_detail")

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self._programs = programs
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def program(self, lattice: Lattice, bands: int, *, textured: bool = False) -> Program:
        """The program of one lattice and one number of bands, for meshes with textures or without."""
        defines: dict[str, object] = {"BANDS": bands, "MAX_SURFACES": MAX_SURFACES}
        return self._programs.get(
            FULL_SCREEN,
            "target/shade.frag",
            {**defines, **({"TEXTURED": ""} if textured else {}), **_lattice_defines(lattice)},
            self.SAMPLERS + self.TEXTURED * textured,
        )

    def run(
        self,
        framebuffer: moderngl.Framebuffer,
        rect: PixelRect,
        program: Program,
        surface: moderngl.Texture,
        depth: moderngl.Texture,
        shadow: moderngl.Texture,
        **texels: moderngl.Texture,
    ) -> None:
        """Shade the pixels of ``rect``; ``texels`` are the samplers of a textured mesh."""
        framebuffer.use()
        framebuffer.viewport = rect.viewport
        self._context.enable_only(self._context.NOTHING)
        program.bind_textures(t_surface=surface, t_depth=depth, t_shadow=shadow, **texels)
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(program.gl, [])
        self._arrays[program].render(vertices=3)


def _lattice_defines(lattice: Lattice) -> dict[str, object]:
    """The lattice as GLSL: a macro that applies F to every sample, so that no loop indexes an array."""
    each = " ".join(f"F({k}, {i}, {j})" for k, (i, j, _, _) in enumerate(lattice.offsets()))
    return {
        "LATTICE_A": lattice.a,
        "LATTICE_PHASE": lattice.phase,
        "SAMPLES": lattice.samples,
        "FOR_EACH_SAMPLE(F)": each,
    }
