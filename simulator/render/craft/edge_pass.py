"""Edge pass: exact coverage of the pixels on the target's edges.

For each pixel it stores a slope by which the shading pass weights the pixel's samples, so that the weighted area on
either side of an edge is the exact one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.craft.sample_pattern import pattern_defines
from flyaround.simulator.render.craft.visible_edges import REACH_PX
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.buffer_pool import BufferPool
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.view import SCENE

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources

EXACT_AREAS = "EXACT_AREAS"
"""Preprocessor define of the preset `high`, which also sums areas of parts that several edges bound in one pixel."""
_QUAD_INDICES = np.array([0, 1, 2, 2, 1, 3], np.uint32)  # corners of the two triangles of an edge's quad


def edge_defines(*, exact: bool) -> dict[str, object]:
    """Return the preprocessor defines of the shaders that write and read the slopes."""
    return {EXACT_AREAS: ""} if exact else {}


class SlopeImage:
    """Render target of the slopes of the sample weights [px-1].

    With ``exact`` it also stores for each pixel the number of edges and the areas of parts.
    """

    def __init__(self, context: moderngl.Context, width: int, height: int, *, exact: bool) -> None:
        self._context = context
        self.slope = context.texture((width, height), 4 if exact else 1, dtype="f4")
        self.slope.filter = (context.NEAREST, context.NEAREST)
        self.framebuffer = context.framebuffer([self.slope])

    def release(self) -> None:
        """Free the image."""
        release(self._context, self.framebuffer, self.slope)


EDGE_SLOPES: Resource[moderngl.Texture] = Resource("edge slopes")


class EdgePass(Pass):
    """Draws the target's edges, so that the coverage of edge pixels is not limited by the number of samples."""

    name = "target.edges"
    reads = (SCENE, TARGET)
    writes = (EDGE_SLOPES,)
    submits = True

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        context = self._context
        self._images = BufferPool(lambda w, h: SlopeImage(context, w, h, exact=False))
        self._exact_images = BufferPool(lambda w, h: SlopeImage(context, w, h, exact=True))

    def run(self, r: PassResources) -> None:
        """Write slopes of sample weights for the target's rectangle, whose first pixel is (0, 0)."""
        placed, exact = r[TARGET], r[SCENE].quality == "high"
        buffers, view = placed.drawn_mesh.edges, placed.edge_view
        rect = view.rect
        image = (self._exact_images if exact else self._images).at_least(rect.width, rect.height)
        r[EDGE_SLOPES] = image.slope
        draw_to(image.framebuffer)
        image.framebuffer.clear()
        edges, outlines = buffers.visible_edges.select(view, pairs=exact)
        if not len(edges):
            return
        draw_to(image.framebuffer)
        image.framebuffer.viewport = (0, 0, rect.width, rect.height)
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        defines = {**pattern_defines(placed.lattice), **edge_defines(exact=exact), "REACH_PX": REACH_PX}
        program = self._programs.get("craft/edge.vert", "craft/edge.frag", defines)
        program.set("u_window", rect.viewport)
        layout, names = "3f 3f 1f 4x", ["in_start_m", "in_end_m", "in_corner"]
        if exact:
            # outlines of parts come first: those whose first adjacent face is visible, then those whose second one is
            program.set("u_outlines", tuple(2 * n for n in outlines))
            layout, names = "3f 3f 1f 1f", [*names, "in_material"]
        indices = (np.asarray(edges, np.uint32)[:, None] * np.uint32(4) + _QUAD_INDICES).ravel()
        buffers.indices.orphan()
        buffers.indices.write(indices.tobytes())
        buffers.vertex_array(program, layout, names).render(vertices=len(indices))
