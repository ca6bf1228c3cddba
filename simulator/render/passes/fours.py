"""Fours pass: what was drawn pixel by pixel joins what was drawn four to a texel. Reads the radiance; writes texels."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import Float32Array
    from simulator.render.cells import Cells
    from simulator.render.images import Images
    from simulator.render.programs import ProgramLibrary

LEAST_SHARE = 0.4
"""Of the image that must gain: reading texels of four takes as long as a tenth of the Earth's pixels."""


class FoursPass:
    """Copies cells of the image that were drawn pixel by pixel to the texels of four."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context = context
        self._program = programs.get("common/cells.vert", "common/fours.frag", {}, ("t_image",))
        self._cells = context.buffer(reserve=8, dynamic=True)
        self._array = context.vertex_array(
            self._program.gl, [(self._cells, "2f", "in_pixel")], mode=context.POINTS
        )

    def run(self, images: Images, cells: Cells, centers: Float32Array) -> None:
        """Copy cells.

        Parameters
        ----------
        centers : (K, 2) middles of some of ``cells``.
        """
        if not len(centers):
            return
        width, height = cells.extent_px
        framebuffer = images.fours_framebuffer
        framebuffer.use()
        framebuffer.viewport = (0, 0, width // 2, height // 2)
        self._context.enable_only(self._context.PROGRAM_POINT_SIZE)
        self._program.bind_textures(t_image=images.radiance)
        self._program.set("u_extent_px", cells.extent_px)
        self._program.set("u_point_px", cells.size_px / 2)
        self._cells.orphan(centers.nbytes)
        self._cells.write(centers)
        self._array.render(vertices=len(centers))
