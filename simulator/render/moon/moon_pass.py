"""Moon pass: its disc or its ground, lit by Sun and Earth. Reads map, craters, coverage; adds to the radiance."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.render.gl.fences import draw_to, flush
from flyaround.simulator.render.globe.air_pass import AIR_SAMPLERS, TABLE_DEFINES
from flyaround.simulator.render.moon.craters import (
    BROAD_LARGEST_PX,
    FINE_LARGEST_PX,
    SLOPE_MAX,
    crater_texture,
)
from flyaround.simulator.render.moon.craters import SIZE as CRATERS_SIZE
from flyaround.simulator.render.moon.moon_tiles import one_tile
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.scene.illumination.moonlight import surface_phase

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.moon.moon_tiles import MoonTiles
    from flyaround.simulator.render.moon.moon_view import MoonView
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import ByteArray

MAP = "albedo_4096x2048.jpg"
MAP_SCALE = 2.5  # of the map's 8 bits, in means of the near side
MAP_VERSION = 4  # of `moon_map`: raise it when the same file gives another map
TEXEL_KM = 2.665  # of the map, at the equator
BROAD_KM, FINE_KM = 403.0, 63.0  # periods of the two tiles of craters
_PHASES = 512
SAMPLES, STRIDE = 13, 5  # of a fine pixel; sample k lies in column k and row 5 k mod 13 of a grid of 13 by 13
_OWN = ("t_coverage", "t_moon", "t_broad", "t_fine", "t_phase", "t_umbra")


def moon_map() -> ByteArray:
    """(2048, 4096) normal albedo over its mean on the near side, over ``MAP_SCALE``; from the cache."""
    try:
        data = resources.files("flyaround.assets").joinpath("moon", MAP).read_bytes()
    except FileNotFoundError as error:
        raise UserError(f"the map assets/moon/{MAP} is missing; install Flyaround again") from error

    def make() -> ByteArray:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise UserError(f"the map assets/moon/{MAP} cannot be decoded; install Flyaround again")
        latitude = np.radians(90 - (np.arange(2048) + 0.5) / 2048 * 180)[:, None]
        longitude = np.radians((np.arange(4096) + 0.5) / 4096 * 360 - 180)[None, :]
        # the ground of the near side, limb and middle alike, as all phases together show it
        weight = np.cos(latitude) * (np.cos(longitude) > 0)
        # the mosaic is a picture: this power gives the maria half the highlands' albedo (0.07 and 0.13)
        image = (image / np.float32(255)) ** np.float32(0.75)
        mean = float((image * weight).sum() / weight.sum())
        return np.asarray(np.clip(image / (mean * MAP_SCALE) * 255 + 0.5, 0, 255), np.uint8)

    return cached_array(entry_name("moon", MAP_VERSION, len(data)), make)


class MoonPass:
    """Its textures are uploaded when it is made, which is when the Moon is first in view."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context, self._programs = context, programs
        albedo = moon_map()
        self._map = context.texture(albedo.shape[::-1], 1, albedo, alignment=1)
        self._craters = []
        for largest in (BROAD_LARGEST_PX, FINE_LARGEST_PX):
            craters = crater_texture(largest)
            self._craters.append(context.texture(craters.shape[1::-1], 4, craters))
        for texture in (self._map, *self._craters):
            texture.build_mipmaps()
            texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self._map.repeat_y = False
        phase = surface_phase((np.arange(_PHASES) + 0.5) / _PHASES * np.pi).astype(np.float32)
        self._phase = context.texture((_PHASES, 1), 1, phase.tobytes(), dtype="f4")
        self._umbra = context.texture((256, 1), 4, dtype="f4")
        for texture in (self._phase, self._umbra):
            texture.filter = (context.LINEAR, context.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self._arrays: dict[Program, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}

    def release(self) -> None:
        """Free maps, tables and vertex arrays; the programs are the library's."""
        for buffer, array in self._arrays.values():
            array.release()
            buffer.release()
        for texture in (self._map, *self._craters, self._phase, self._umbra):
            texture.release()

    def run(
        self,
        images: FrameImages,
        moon: MoonView,
        *,
        earth: bool,
        air: list[moderngl.Texture] | None,
        fine: bool = False,
        tiles: list[MoonTiles] | None = None,
    ) -> None:
        """Add the Moon.

        Parameters
        ----------
        earth : whether the Earth may hide it. air : this frame's air table, which dims it; ``None`` without air.
        fine : several rays a pixel, so that shadows seen at a grazing angle end smoothly.
        tiles : of `moon_tiles`; without them every pixel is worked out by itself.
        """
        if moon.rect is None:
            return
        behind = earth and not moon.in_front
        air = air if behind else None
        share = np.ones((256, 4), np.float32)
        if moon.shadow_share is not None:
            share[:, : moon.shadow_share.shape[1]] = moon.shadow_share
        flush(self._context)  # what still reads the last frame's, and this frame's sky, are waited for here
        self._umbra.write(share.tobytes())
        images.mark_lit(moon.rect)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = moon.rect.viewport
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        for kind in tiles or [one_tile(moon.rect)]:
            program = self._program(images.bands, kind, behind=behind, air=air, fine=fine)
            self._draw(program, images, air, moon.rect, kind)

    def _program(
        self, bands: int, kind: MoonTiles, *, behind: bool, air: list[moderngl.Texture] | None, fine: bool
    ) -> Program:
        return self._programs.get(
            "moon/tiles.vert",
            "moon/moon.frag",
            {
                "BANDS": bands,
                "GLOBE": int(behind),
                "AIR": int(air is not None),
                "SLOPE_MAX": SLOPE_MAX,
                "SAMPLES": SAMPLES if fine else 1,
                "STRIDE": STRIDE,
                "SMOOTH": int(kind.smooth),
                "COVERED": int(kind.covered),
                "BROAD_KM": BROAD_KM,
                "FINE_KM": FINE_KM,
                "TEXEL_KM": TEXEL_KM,
                # the map's texels are wider than tiles: between their corners it is as good as straight
                "MAP_AT_CORNERS": int(kind.smooth and kind.footprint_km * kind.size_px < TEXEL_KM),
                **TABLE_DEFINES,
            },
            (*_OWN, *(AIR_SAMPLERS[bands] if air is not None else ())),
        )

    def _draw(
        self,
        program: Program,
        images: FrameImages,
        air: list[moderngl.Texture] | None,
        rect: PixelRect,
        kind: MoonTiles,
    ) -> None:
        c = self._context
        texels_km = (TEXEL_KM, BROAD_KM / CRATERS_SIZE, FINE_KM / CRATERS_SIZE)
        for texture, texel_km in zip((self._map, *self._craters), texels_km, strict=True):
            # larger than life it has one level, and a driver that need not ask is quicker
            smaller = c.LINEAR_MIPMAP_NEAREST if kind.smooth else c.LINEAR_MIPMAP_LINEAR
            texture.filter = (c.LINEAR if kind.footprint_km <= texel_km else smaller, c.LINEAR)
        program.bind_textures(
            t_coverage=images.coverage,
            t_moon=self._map,
            t_broad=self._craters[0],
            t_fine=self._craters[1],
            t_phase=self._phase,
            t_umbra=self._umbra,
        )
        if air is not None:
            program.bind_textures(**dict(zip(AIR_SAMPLERS[images.bands], air, strict=True)))
        program.set("u_window", rect.viewport)
        if program not in self._arrays:
            buffer = self._context.buffer(reserve=8, dynamic=True)
            array = self._context.vertex_array(program.gl, [(buffer, "2f", "in_pixel")])
            self._arrays[program] = buffer, array
        buffer, array = self._arrays[program]
        buffer.orphan(kind.triangles_px.nbytes)
        buffer.write(kind.triangles_px)
        array.render(vertices=len(kind.triangles_px))
