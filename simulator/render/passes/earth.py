"""Earth pass: ground, clouds and air behind the target. Reads maps, air table and coverage; adds to the radiance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from simulator.render.airtables import GROUND_MU_MIN, GROUND_SAMPLES, air_tables
from simulator.render.maps import packed_maps
from simulator.render.noise import GRAIN, PERIOD_KM, SIZE, SLOPE_PER_KM, detail_texture
from simulator.render.passes.air import TABLE_DEFINES, AirPass

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import ByteArray
    from simulator.render.cells import CellKind, Cells
    from simulator.render.images import Images
    from simulator.render.programs import Program, ProgramLibrary
    from simulator.scene.state import Bands, Environment, SceneState

DETAIL_TEXEL_KM = PERIOD_KM / SIZE
LOG2_TEXEL_KM = math.log2(4.97)  # of the maps at the equator, as in shaders/earth/point.glsl
_SAMPLERS = {
    1: ("t_coverage", "t_map", "t_detail", "t_air"),
    3: (
        "t_coverage",
        "t_map",
        "t_detail",
        "t_colour",
        "t_ground",
        "t_air_rayleigh",
        "t_air_mie",
        "t_air_transmittance",
    ),
}


class EarthPass:
    """The Earth for one number of bands; its maps are uploaded when it is made."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, bands: Bands) -> None:
        self._context, self._programs = context, programs
        self.bands = 1 if bands == "mono" else 3
        self.tables = air_tables(bands)
        self.air = AirPass(context, programs, self.bands, self.tables)
        self._maps = [self._mapped(image) for image in packed_maps(self.bands)]
        self._detail = context.texture((SIZE, SIZE), 4, detail_texture())
        self._detail.build_mipmaps()
        self._corners = context.buffer(reserve=64, dynamic=True)
        self._arrays: dict[Program, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}

    def _mapped(self, image: ByteArray) -> moderngl.Texture:
        height, width, channels = image.shape
        texture = self._context.texture((width, height), channels, image)
        texture.build_mipmaps()
        texture.filter = (self._context.LINEAR_MIPMAP_LINEAR, self._context.LINEAR)
        texture.repeat_x, texture.repeat_y = True, False
        return texture

    def _program(self, environment: Environment, kind: CellKind, *, behind: bool) -> Program:
        defines: dict[str, object] = {
            "BANDS": self.bands,
            "AIR": int(environment.atmosphere),
            "CLOUDS": int(environment.clouds),
            "GLINT": int(environment.ocean_glint),
            "NIGHT": int(environment.night_lights and kind.night),
            "SMOOTH": int(kind.smooth),
            "COVERED": int(kind.covered),
            "MOON": int(behind),
            "DETAIL_KM": PERIOD_KM,
            "DETAIL_TEXEL_KM": DETAIL_TEXEL_KM,
            "SLOPE_PER_KM": SLOPE_PER_KM,
            "GRAIN": GRAIN,
            "GROUND_MU_MIN": GROUND_MU_MIN,
            "GROUND_SAMPLES": GROUND_SAMPLES,
            **TABLE_DEFINES,
        }
        return self._programs.get("earth/earth.vert", "earth/earth.frag", defines, _SAMPLERS[self.bands])

    def run(self, images: Images, cells: Cells, scene: SceneState, *, behind: bool) -> None:
        """Add the Earth's light to ``images``.

        Parameters
        ----------
        behind : the Moon is nearer, and may hide it.
        """
        environment, quality = scene.environment, scene.quality
        # half of a trilinear fetch's cost is its second level, and a cell has one level anyway
        smallest = (
            self._context.LINEAR_MIPMAP_LINEAR if quality == "high" else self._context.LINEAR_MIPMAP_NEAREST
        )
        self._detail.filter = (smallest, self._context.LINEAR)
        self._corners.orphan(cells.corners_px.nbytes)
        self._corners.write(cells.corners_px.tobytes())
        images.sky_framebuffer.use()
        images.sky_framebuffer.viewport = (0, 0, *images.size)
        self._context.blend_func = self._context.ONE, self._context.ONE
        for kind, triangles in cells.triangles.items():
            program = self._program(environment, kind, behind=behind)
            # the first light of the sky: where nothing can be in front it is written, which is cheaper than added
            self._context.enable_only(self._context.BLEND if kind.covered else self._context.NOTHING)
            program.bind_textures(**self._textures(images))
            program.set("u_size", images.size)
            program.set("u_level", (kind.level - LOG2_TEXEL_KM, kind.level - math.log2(DETAIL_TEXEL_KM)))
            if program not in self._arrays:
                indices = self._context.buffer(reserve=triangles.nbytes, dynamic=True)
                array = self._context.vertex_array(
                    program.gl, [(self._corners, "2f", "in_pixel")], index_buffer=indices
                )
                self._arrays[program] = (indices, array)
            indices, array = self._arrays[program]
            indices.orphan(triangles.nbytes)
            indices.write(triangles.tobytes())
            array.render(vertices=len(triangles))

    def _textures(self, images: Images) -> dict[str, moderngl.Texture]:
        textures = {"t_coverage": images.coverage, "t_map": self._maps[0], "t_detail": self._detail}
        if self.bands == 1:
            return textures | {"t_air": self.air.tables[0]}
        return textures | {
            "t_colour": self._maps[1],
            "t_ground": self.air.ground,
            "t_air_rayleigh": self.air.tables[0],
            "t_air_mie": self.air.tables[1],
            "t_air_transmittance": self.air.tables[2],
        }
