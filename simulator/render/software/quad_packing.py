"""Quad packing for software drivers: 2 x 2 pixels are rendered as one RGBA texel, which costs less than four texels.

Tiles that cannot be rendered this way are copied into the packed image.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.earth.screen_tiles import EARTH_TILES
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.frame_images import RADIANCE, ReadBackPass
from flyaround.simulator.render.gl.fences import draw_to

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.earth.screen_tiles import ScreenTiles
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.runtime.arrays import Float32Array

MIN_SMOOTH_SHARE = 0.4
"""Share of smooth tiles in the image from which on packing is faster: unpacking has a cost."""


def should_pack(images: FrameImages, tiles: ScreenTiles) -> bool:
    """Return True if the Earth's smooth tiles should be drawn four pixels per texel."""
    return images.can_pack_quads and tiles.smooth_share > MIN_SMOOTH_SHARE


QUADS: Resource[bool] = Resource("quads")
"""Present if the Earth's smooth tiles are drawn four pixels per texel."""


class QuadPackingPass(Pass):
    """Pass that copies tiles rendered pixel by pixel into the packed image."""

    name = "earth.quad_packing"
    reads = (QUADS, EARTH_TILES, RADIANCE)
    writes = (QUADS,)

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._tiles = self._context.buffer(reserve=8, dynamic=True)
        self._by_bands: dict[int, tuple[Program, moderngl.VertexArray]] = {}  # keyed by the number of bands

    def _program_and_array(self, bands: int) -> tuple[Program, moderngl.VertexArray]:
        if bands not in self._by_bands:
            program = self._programs.get(
                "common/tiles.vert", "common/quads.frag", {"BANDS": bands}, ("t_image",)
            )
            array = self._context.vertex_array(
                program.gl, [(self._tiles, "2f", "in_pixel")], mode=self._context.POINTS
            )
            self._by_bands[bands] = program, array
        return self._by_bands[bands]

    def run(self, r: PassResources) -> None:
        """Copy the tiles that are not smooth."""
        images, tiles = r[RADIANCE], r[EARTH_TILES]
        centers = tiles.rough_centers_px
        if not len(centers):
            return
        width, height = tiles.extent_px
        framebuffer = images.quad_framebuffer
        draw_to(framebuffer)
        framebuffer.viewport = (0, 0, width // 2, height // 2)
        self._context.enable_only(self._context.PROGRAM_POINT_SIZE)
        program, array = self._program_and_array(images.bands)
        program.bind_textures(t_image=images.radiance)
        program.set("u_extent_px", tiles.extent_px)
        program.set("u_point_px", tiles.size_px / 2)
        self._tiles.orphan(centers.nbytes)
        self._tiles.write(centers)
        array.render(vertices=len(centers))


class ReadQuadsPass(ReadBackPass):
    """Pass that waits for the driver and reads the image, unpacking it if necessary."""

    optional = (*ReadBackPass.optional, QUADS)

    def _read(self, r: PassResources) -> Float32Array:
        return r[RADIANCE].read_radiance(quads=r.find(QUADS) is not None)
