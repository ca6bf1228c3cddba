"""Edge pass: analytic coverage of edges, as slopes of sample weights. Reads the edges; writes one slope a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.sample_pattern import pattern_defines
from flyaround.simulator.render.craft.visible_edges import REACH_PX
from flyaround.simulator.render.gl.buffer_pool import BufferPool
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.sample_pattern import SamplePattern
    from flyaround.simulator.render.craft.visible_edges import EdgeCamera, VisibleEdges
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import IntArray

EXACT_AREAS = "EXACT_AREAS"
"""Define of the shaders: the areas of parts that several edges end in a pixel are summed too (preset `high`)."""
_PATTERN = np.array([0, 1, 2, 2, 1, 3], np.uint32)


def edge_defines(*, exact: bool) -> dict[str, object]:
    """Defines of the shaders that write the slopes and read them."""
    return {EXACT_AREAS: ""} if exact else {}


class EdgeBuffers:
    """The edges of one mesh on the GPU, and the list of those that this frame draws."""

    def __init__(self, context: moderngl.Context, seen: VisibleEdges) -> None:
        self._context = context
        self._arrays: dict[Program, moderngl.VertexArray] = {}
        self.seen = seen
        self.vertices = context.buffer(self.seen.edges.quads().tobytes() or b"\0")
        self.indices = context.buffer(reserve=max(4 * 6 * len(seen.edges.ends), 4), dynamic=True)

    def vertex_array(self, program: Program, layout: str, names: list[str]) -> moderngl.VertexArray:
        """The edges as a program reads them: they go with the mesh, where a pass would keep its buffers for ever."""
        if program not in self._arrays:
            content = [(self.vertices, layout, *names)]
            self._arrays[program] = self._context.vertex_array(program.gl, content, self.indices)
        return self._arrays[program]

    def release(self) -> None:
        """Free the buffers and vertex arrays."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self.vertices.release()
        self.indices.release()


class SlopeImage:
    """Slope of the samples' weights per pixel [px-1], how many edges were met, and parts' areas where ``exact``."""

    def __init__(self, context: moderngl.Context, width: int, height: int, *, exact: bool) -> None:
        self._context = context
        self.slope = context.texture((width, height), 4 if exact else 1, dtype="f4")
        self.slope.filter = (context.NEAREST, context.NEAREST)
        self.framebuffer = context.framebuffer([self.slope])

    def release(self) -> None:
        """Free the image."""
        release(self._context, self.framebuffer, self.slope)


@dataclass(frozen=True, eq=False)
class EdgeList:
    """The edges ``seen`` that a frame draws over the pixels of ``rect``, and what they are drawn into.

    At the first ``outlines`` of them their part ends: at so many that show their first face, and so many the second.
    """

    image: SlopeImage
    rect: PixelRect
    buffers: EdgeBuffers
    seen: IntArray
    outlines: tuple[int, int]
    exact: bool


class EdgePass:
    """Draws the edges over the pixels that hold the target; samples alone place an edge 0.05 to 0.2 pixels off."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context, self._programs = context, programs
        self._images = BufferPool(lambda w, h: SlopeImage(context, w, h, exact=False))
        self._exact_images = BufferPool(lambda w, h: SlopeImage(context, w, h, exact=True))

    def begin(
        self,
        buffers: EdgeBuffers,
        view: EdgeCamera,
        *,
        exact: bool,
    ) -> EdgeList:
        """Empty the slopes of the view's pixels and find the edges to draw there.

        Parameters
        ----------
        exact : as `EXACT_AREAS`.
        """
        image = (self._exact_images if exact else self._images).at_least(view.rect.width, view.rect.height)
        draw_to(image.framebuffer)
        image.framebuffer.clear()
        seen, outlines = buffers.seen.numbers(view, pairs=exact)
        return EdgeList(image, view.rect, buffers, seen, outlines, exact)

    def run(self, edges: EdgeList, lattice: SamplePattern) -> moderngl.Texture:
        """Slopes of the samples' weights in the pixels of the list's rectangle, its first pixel at (0, 0)."""
        image, rect, buffers, seen = edges.image, edges.rect, edges.buffers, edges.seen
        if not len(seen):
            return image.slope
        draw_to(image.framebuffer)
        image.framebuffer.viewport = (0, 0, rect.width, rect.height)
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        defines = {**pattern_defines(lattice), **edge_defines(exact=edges.exact), "REACH_PX": REACH_PX}
        program = self._programs.get("craft/edge.vert", "craft/edge.frag", defines)
        program.set("u_window", rect.viewport)
        layout, names = "3f 3f 1f 4x", ["in_start_m", "in_end_m", "in_corner"]
        if edges.exact:
            program.set("u_outlines", tuple(2 * n for n in edges.outlines))
            layout, names = "3f 3f 1f 1f", [*names, "in_material"]
        indices = (np.asarray(seen, np.uint32)[:, None] * np.uint32(4) + _PATTERN).ravel()
        buffers.indices.orphan()
        buffers.indices.write(indices.tobytes())
        buffers.vertex_array(program, layout, names).render(vertices=len(indices))
        return image.slope
