"""Moon pass: draws the Moon, lit by Sun and Earth, from its albedo map and procedural craters."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.craters import (
    BROAD_MAX_PX,
    DEVIATION_MAX,
    FINE_MAX_PX,
    SLOPE_MAX,
    crater_levels,
)
from flyaround.simulator.celestial.craters import SIZE as CRATERS_SIZE
from flyaround.simulator.errors import UserError
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.frame_graph import Pass
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE
from flyaround.simulator.render.gl.fences import draw_to, flush
from flyaround.simulator.render.gl.mipmaps import texture_of_levels
from flyaround.simulator.render.globe.frame_air import AIR_SAMPLERS, AIR_TABLES, TABLE_DEFINES
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.moon.moon_view import MOON
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.scene.illumination.moonlight import surface_phase

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

MAP = "albedo_4096x2048.jpg"
"""Albedo map in the assets; assets/NOTICE names its source."""
MAP_SCALE = 2.5
"""Largest value of the 8-bit map over the mean of the near side."""
TEXEL_KM = 2.665
"""Width of a texel of the map at the equator."""
BROAD_KM, FINE_KM = 403.0, 63.0
"""Periods of the two tiling crater textures."""
_PHASES = 512  # texels of the table over the phase angle
SAMPLES, STRIDE = 13, 5
"""Samples per pixel in `high`: sample k lies in column k and row 5 k mod 13 of a 13 x 13 grid (N-rooks)."""
_SAMPLERS = ("t_coverage", "t_moon", "t_broad", "t_fine", "t_phase", "t_umbra")


def moon_map() -> ByteArray:
    """Return the Moon's normal albedo, relative to the mean of the near side; it is cached.

    Returns
    -------
    (2048, 4096) array
        8-bit values; 255 is ``MAP_SCALE`` times the mean. Row 0 is the north pole, column 0 longitude -180 degrees.

    Raises
    ------
    UserError
        If the map is missing or cannot be decoded.
    """
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
        # mean over the area of the near side, limb and centre alike
        weight = np.cos(latitude) * (np.cos(longitude) > 0)
        # the mosaic is not photometric: this power gives the maria half the highlands' albedo (0.07 and 0.13)
        image = (image / np.float32(255)) ** np.float32(0.75)
        mean = float((image * weight).sum() / weight.sum())
        return np.asarray(np.clip(image / (mean * MAP_SCALE) * 255 + 0.5, 0, 255), np.uint8)

    return cached_array(entry_name("moon", (moon_map,), len(data)), make)


@dataclass(frozen=True, eq=False)
class MoonTiles:
    """Tiles of the Moon's rectangle that one draw call draws.

    Parameters
    ----------
    triangles_px : (6 K, 2) array
        Corners of two triangles per tile [px].
    smooth : bool, optional
        True if the ground is interpolated between the corners.
    covered : bool, optional
        True if the target may be in front.
    footprint_km : float, optional
        Largest footprint of a pixel on the ground; infinite if unknown.
    size_px : int, optional
        Side of a tile.
    """

    triangles_px: Float32Array
    smooth: bool = False
    covered: bool = True
    footprint_km: float = float("inf")
    size_px: int = 0


def one_tile(rect: PixelRect) -> MoonTiles:
    """Return a rectangle as a single tile with all features."""
    x_px, y_px = np.array([rect.x0, rect.x1]) - 0.5, np.array([rect.y0, rect.y1]) - 0.5
    return MoonTiles(grid_triangles(x_px, y_px).reshape(-1, 2))


def grid_triangles(x_px: FloatArray, y_px: FloatArray) -> Float32Array:
    """Return the corners (rows, columns, 6, 2) of the two triangles of each cell of a grid [px]."""
    corners = np.stack(np.meshgrid(x_px, y_px), axis=-1).astype(np.float32)
    upper_left, upper_right, lower_left, lower_right = (
        corners[:-1, :-1],
        corners[:-1, 1:],
        corners[1:, :-1],
        corners[1:, 1:],
    )
    return np.stack([upper_left, lower_left, upper_right, upper_right, lower_left, lower_right], axis=2)


class MoonTextures:
    """The Moon's map, craters and photometric tables on the GPU."""

    def __init__(self, context: moderngl.Context) -> None:
        albedo = moon_map()
        self.map = context.texture(albedo.shape[::-1], 1, albedo, alignment=1)
        self.craters = []
        for largest, wide_km in ((BROAD_MAX_PX, BROAD_KM), (FINE_MAX_PX, FINE_KM)):
            self.craters.append(texture_of_levels(context, crater_levels(largest, wide_km / CRATERS_SIZE)))
        self.map.build_mipmaps()
        for texture in (self.map, *self.craters):
            texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
        self.map.repeat_y = False
        phase = surface_phase((np.arange(_PHASES) + 0.5) / _PHASES * np.pi).astype(np.float32)
        self.phase = context.texture((_PHASES, 1), 1, phase.tobytes(), dtype="f4")
        self.umbra = context.texture((256, 1), 4, dtype="f4")
        for texture in (self.phase, self.umbra):
            texture.filter = (context.LINEAR, context.LINEAR)
            texture.repeat_x = texture.repeat_y = False

    def release(self) -> None:
        """Free the textures."""
        for texture in (self.map, *self.craters, self.phase, self.umbra):
            texture.release()


class MoonPass(Pass):
    """Adds the Moon to the radiance, computed per pixel. Its textures are uploaded when it is first in view."""

    name = "moon"
    reads = (SCENE, MOON, *IMAGES)
    optional = (GLOBE, AIR_TABLES, TARGET)
    writes = (RADIANCE,)

    def __init__(self, device: Device) -> None:
        self._device, self._context, self._programs = device, device.context, device.programs
        self._uploaded: MoonTextures | None = None
        self._arrays: dict[Program, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}

    def release(self) -> None:
        """Free maps, tables and vertex arrays; programs belong to the library."""
        for buffer, array in self._arrays.values():
            array.release()
            buffer.release()
        if self._uploaded is not None:
            self._uploaded.release()

    def _textures(self) -> MoonTextures:
        if self._uploaded is None:
            self._uploaded = MoonTextures(self._context)
            self._device.check("uploading the Moon's map")
        return self._uploaded

    def _tiles(self, r: PassResources, rect: PixelRect) -> list[MoonTiles]:  # noqa: ARG002
        """Return the tiles to draw: one, of all pixels that the Moon can touch."""
        return [one_tile(rect)]

    def run(self, r: PassResources) -> None:
        """Draw the Moon where the globe leaves room."""
        moon, earth, images = r[MOON], r.find(GLOBE), r[RADIANCE]
        if moon.rect is None or (earth is not None and earth.fills_image and not moon.in_front):
            return
        # several rays per pixel smooth shadows seen at a grazing angle
        fine = r[SCENE].quality == "high"
        textures, tiles = self._textures(), self._tiles(r, moon.rect)
        is_behind_globe = earth is not None and not moon.in_front
        air = r.find(AIR_TABLES) if is_behind_globe else None
        share = np.ones((256, 4), np.float32)
        if moon.shadow_share is not None:
            share[:, : moon.shadow_share.shape[1]] = moon.shadow_share
        # writing the texture waits for the driver's threads, so start their queued work first
        flush(self._context)
        textures.umbra.write(share.tobytes())
        images.mark_drawn(moon.rect)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = moon.rect.viewport
        self._context.enable_only(self._context.BLEND)
        self._context.blend_func = self._context.ONE, self._context.ONE
        for kind in tiles:
            program = self._program(images.bands, kind, behind=is_behind_globe, air=air, fine=fine)
            self._draw(program, textures, images, air, moon.rect, kind)

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
                "DEVIATION_MAX": DEVIATION_MAX,
                "SAMPLES": SAMPLES if fine else 1,
                "STRIDE": STRIDE,
                "SMOOTH": int(kind.smooth),
                "COVERED": int(kind.covered),
                "BROAD_KM": BROAD_KM,
                "FINE_KM": FINE_KM,
                "TEXEL_KM": TEXEL_KM,
                # the map's texels are wider than tiles, so linear interpolation suffices
                "MAP_AT_CORNERS": int(kind.smooth and kind.footprint_km * kind.size_px < TEXEL_KM),
                **TABLE_DEFINES,
            },
            (*_SAMPLERS, *(AIR_SAMPLERS[bands] if air is not None else ())),
        )

    def _draw(
        self,
        program: Program,
        textures: MoonTextures,
        images: FrameImages,
        air: list[moderngl.Texture] | None,
        rect: PixelRect,
        kind: MoonTiles,
    ) -> None:
        context = self._context
        texels_km = (TEXEL_KM, BROAD_KM / CRATERS_SIZE, FINE_KM / CRATERS_SIZE)
        for texture, texel_km in zip((textures.map, *textures.craters), texels_km, strict=True):
            # a magnified texture uses one level, and a driver samples faster if it has no level to select
            min_filter = context.LINEAR_MIPMAP_NEAREST if kind.smooth else context.LINEAR_MIPMAP_LINEAR
            texture.filter = (context.LINEAR if kind.footprint_km <= texel_km else min_filter, context.LINEAR)
        program.bind_textures(
            t_coverage=images.coverage,
            t_moon=textures.map,
            t_broad=textures.craters[0],
            t_fine=textures.craters[1],
            t_phase=textures.phase,
            t_umbra=textures.umbra,
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
