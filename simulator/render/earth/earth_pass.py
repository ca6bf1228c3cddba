"""Earth pass: draws ground, clouds and air of the Earth behind the target, from its maps and the table of its air."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from flyaround.simulator.celestial.air_tables import GROUND_MU_MIN, GROUND_SAMPLES, air_tables
from flyaround.simulator.celestial.city_lights import MAP_MAX_W_M2_SR as CITY_MAX_W_M2_SR
from flyaround.simulator.celestial.city_lights import MAX_LIGHT as CITY_BRIGHTEST
from flyaround.simulator.celestial.detail_noise import GRAIN, PERIOD_KM, SIZE, SLOPE_PER_KM, cumulus_texture
from flyaround.simulator.celestial.earth_maps import SNOW_REFLECTANCE, TERRAIN_SLOPE_MAX, terrain_texture
from flyaround.simulator.celestial.earth_maps import WIDTH as MAP_WIDTH
from flyaround.simulator.celestial.ocean_colour import SCALE as OCEAN_COLOUR_SCALE
from flyaround.simulator.celestial.sea_ice import WIDTH as ICE_WIDTH
from flyaround.simulator.celestial.sea_ice import sea_ice
from flyaround.simulator.celestial.seasons import OCTAVES, month_gain, season
from flyaround.simulator.celestial.seasons import SLOPE_MAX as GROUND_SLOPE_MAX
from flyaround.simulator.render.earth.map_textures import AUGUST
from flyaround.simulator.render.earth.screen_tiles import EARTH_TILES, ice_day
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE
from flyaround.simulator.render.gl.fences import draw_to, flush
from flyaround.simulator.render.gl.library import draw_one_point
from flyaround.simulator.render.gl.mipmaps import (
    TilingTexture,
    mipmap_chain,
    mipmapped_texture,
    release_mipmapped,
)
from flyaround.simulator.render.globe.frame_air import AIR_SAMPLERS, TABLE_DEFINES, Air, FrameAir
from flyaround.simulator.render.moon.moon_view import MOON
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.world.bodies.earth import EARTH as EARTH_BODY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from concurrent.futures import Future

    from flyaround.simulator.celestial.air_tables import AirTables
    from flyaround.simulator.celestial.seasons import Season
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.earth.screen_tiles import ScreenTiles, TileKind
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.mipmaps import MipmapChain
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.scene.environments import Environment
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState

DETAIL_TEXEL_KM = PERIOD_KM / SIZE
"""Width of a texel of the detail texture on the ground."""
TEXEL_KM = 4.97
"""Width of a texel of the maps at the equator."""
LOG2_TEXEL_KM = math.log2(TEXEL_KM)
CLOUD_KM = 2.0  # height of the clouds, for their parallax and shadows
MAGNIFIED_LEVEL = -0.5  # mipmap level up to which the maps' texels are at least six pixels wide
FAR_LEVEL = 0.5  # mipmap level above which ice floes and cloud detail are averaged
# samplers of every frame, and of maps that only some frames need
_COMMON_SAMPLERS = (
    "t_coverage",
    "t_radiance",
    "t_map",
    "t_detail",
    "t_ground_slopes",
    "t_month_before",
    "t_month_after",
)
_OPTIONAL_SAMPLERS = ("t_ice", "t_ocean_colour", "t_terrain", "t_city")
_SAMPLERS = {
    1: (*_COMMON_SAMPLERS, *_OPTIONAL_SAMPLERS, "t_air", "t_ground"),
    3: (*_COMMON_SAMPLERS, *_OPTIONAL_SAMPLERS, "t_colour", "t_ground", *AIR_SAMPLERS[3]),
}


def map_season(scene: SceneState) -> Season:
    """Return the two months between which the maps are interpolated."""
    return season(scene.epoch_utc) if scene.environment.seasons else AUGUST


@dataclass(frozen=True)
class EarthDraw:
    """State of one draw call.

    Parameters
    ----------
    program : Program
        Program of the tiles' kind.
    framebuffer : Framebuffer
        Framebuffer to draw into.
    viewport : tuple of int
        Part of the framebuffer to draw into.
    blended : bool
        True to add to its contents.
    tile_px : float
        Side of its tiles [px].
    detail : Texture
        Detail texture.
    city : Texture or None
        Texture of the city lights; None if they are off.
    level : float or None
        Mipmap level of `TileKind`; ``None`` if all maps are sampled at their first level.
    """

    program: Program
    framebuffer: moderngl.Framebuffer
    viewport: tuple[int, int, int, int]
    blended: bool
    tile_px: float
    detail: moderngl.Texture
    city: moderngl.Texture | None
    level: float | None


@dataclass(frozen=True, eq=False)
class EarthFrame:
    """Resources that a frame's Earth is drawn from.

    Parameters
    ----------
    images : FrameImages
        Images to draw into.
    tiles : ScreenTiles
        Tiles of the screen that the Earth fills.
    scene : SceneState
        Scene of the frame.
    moon_in_front : bool
        True if the Moon is nearer, and may hide the Earth.
    """

    images: FrameImages
    tiles: ScreenTiles
    scene: SceneState
    moon_in_front: bool

    @staticmethod
    def from_resources(r: PassResources) -> EarthFrame:
        """Collect the resources from those of a pass."""
        moon_view = r.find(MOON)
        return EarthFrame(r[RADIANCE], r[EARTH_TILES], r[SCENE], moon_view is not None and moon_view.in_front)


class Earth:
    """The Earth's maps, air and programs on the GPU, for one set of bands. The constructor uploads the maps.

    Parameters
    ----------
    context : Context
        OpenGL context.
    programs : ProgramLibrary
        Programs of the context.
    bands : Bands
        Spectral bands of the camera.
    prefetched : EarthMaps
        Prefetched maps of a scene with these bands; the constructor waits for them.
    precompiles : bool, optional
        True to draw one tile of each kind alone, so that a software driver compiles the programs while other threads
        continue.
    """

    def __init__(
        self,
        context: moderngl.Context,
        programs: ProgramLibrary,
        bands: Bands,
        prefetched: EarthMaps,
        *,
        precompiles: bool = False,
    ) -> None:
        self._precompiles = precompiles
        self._context, self._programs = context, programs
        self.bands = 1 if bands == "mono" else 3
        self._airs: dict[tuple[float, float], Air] = {}
        self._names: Bands = bands
        # uploaded one by one in the order in which they are prepared, so that each can be freed before the next
        pending = prefetched.maps.result()
        self._maps = [self._map_texture(pending.pop(0)) for _ in range(len(pending))]
        self._months = {
            month: self._map_texture(levels) for month, levels in prefetched.months.result().items()
        }
        self.detail, self.night = (
            TilingTexture(context, levels_future) for levels_future in (prefetched.detail, prefetched.night)
        )
        prefetched.detail.result()
        self._of_high: list[moderngl.Texture] = []  # terrain and clouds of `high`
        self._ground_slopes = self._map_texture(prefetched.ground_slopes.result())
        self._keep_air(prefetched.air.result())
        self._ice: tuple[str, moderngl.Texture] | None = None  # date and texture
        self._ocean_colour: Future[MipmapChain] | moderngl.Texture = prefetched.ocean_colour
        self._arrays: dict[Program, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}
        self._program_cache: dict[tuple[object, ...], Program] = {}

    def air(self, environment: Environment) -> Air:
        """Return the air of an environment; it is cached."""
        settings = environment.atmosphere_thickness_km * 1e3, environment.aerosol_optical_depth
        if settings not in self._airs:
            self._keep_air(air_tables(self._names, settings[0], aerosol_depth=settings[1]))
        return self._airs[settings]

    def release(self) -> None:
        """Free maps, tables and vertices; programs belong to the library."""
        maps = [*self._of_high, self._ground_slopes, self._ocean_colour]
        maps += [*self._maps, *self._months.values()]
        maps += [] if self._ice is None else [self._ice[1]]
        for texture in maps:
            if isinstance(texture, moderngl.Texture):
                release_mipmapped(texture)
        self.detail.release()
        self.night.release()
        for air in self._airs.values():
            air.frame.release()
        for buffer, array in self._arrays.values():
            array.release()
            buffer.release()

    def _keep_air(self, tables: AirTables) -> None:
        frame = FrameAir(self._context, self._programs, self.bands, tables)
        self._airs[tables.air.thickness_m, tables.air.aerosol_depth] = Air(tables, frame)

    def _map_texture(self, levels: MipmapChain) -> moderngl.Texture:
        texture = mipmapped_texture(self._context, levels)
        texture.filter = (self._context.LINEAR_MIPMAP_LINEAR, self._context.LINEAR)
        texture.repeat_x, texture.repeat_y = True, False
        return texture

    def _month(self, month: int) -> moderngl.Texture:
        if month not in self._months:
            self._months[month] = self._map_texture(mipmap_chain(month_gain(month, self.bands), globe=True))
        return self._months[month]

    def program(self, frame: EarthFrame, kind: TileKind, *, quads: bool) -> Program:
        """Return the program that draws tiles of a kind.

        Parameters
        ----------
        frame : EarthFrame
            Resources of the frame.
        kind : TileKind
            Kind of the tiles.
        quads : bool
            True to draw four pixels per texel.
        """
        environment, behind = frame.scene.environment, frame.moon_in_front
        high, dark = frame.scene.quality == "high", frame.tiles.dark and kind.night
        key = (environment, kind, behind, high, quads, dark, self._programs.lens)
        if key not in self._program_cache:
            defines = self.defines(environment, kind, behind=behind, high=high, quads=quads, dark=dark)
            self._program_cache[key] = self._programs.get(
                "earth/earth.vert",
                "earth/earth.frag",
                defines,
                _SAMPLERS[self.bands],
            )
        return self._program_cache[key]

    def defines(
        self, environment: Environment, kind: TileKind, *, behind: bool, high: bool, quads: bool, dark: bool
    ) -> dict[str, object]:
        """Return the defines of the shaders that draw ground and air."""
        undifferentiated = environment.undifferentiated
        return {
            "BANDS": self.bands,
            "AIR": int(environment.atmosphere),
            "AIR_DEPTH": round(self.air(environment).zenith_depth, 4),
            "CLOUDS": int(environment.clouds),
            "GLINT": int(environment.ocean_glint and not undifferentiated),
            "NIGHT": int(environment.night_lights and kind.night),
            "UNLIT": int(kind.unlit),
            "MOONLIT": int(environment.moon and dark and not kind.unlit),
            "ICE": int(environment.sea_ice and kind.icy and not undifferentiated),
            "ICE_LEVEL": math.log2(MAP_WIDTH / ICE_WIDTH),
            "OCEAN_COLOUR": int(kind.bright_water and not undifferentiated),
            "OCEAN_COLOUR_SCALE": OCEAN_COLOUR_SCALE,
            "SMOOTH": int(kind.smooth),
            "FAR": int(kind.level > FAR_LEVEL or not kind.smooth),
            "AIR_ONLY": int(kind.air),
            "COVERED": int(kind.covered),
            "MOON": int(behind),
            "QUADS": int(quads),
            "MAGNIFIED": int(quads and kind.level <= MAGNIFIED_LEVEL),
            "HIGH": int(high),
            "ONE_OPTICS": int(undifferentiated),
            "RELIEF": float(environment.relief and not undifferentiated),
            "GROUND_SLOPE": GROUND_SLOPE_MAX,
            "OCTAVES": OCTAVES,
            "CLOUD_KM": CLOUD_KM,
            "TEXEL_KM": TEXEL_KM,
            "DETAIL_KM": PERIOD_KM,
            "DETAIL_TEXEL_KM": DETAIL_TEXEL_KM,
            "SLOPE_PER_KM": SLOPE_PER_KM,
            "GRAIN": GRAIN,
            "TERRAIN_SLOPE": TERRAIN_SLOPE_MAX,
            "EARTH_ALBEDO": EARTH_BODY.albedo,
            "SNOW_REFLECTANCE": SNOW_REFLECTANCE,
            "CITY_MAX": CITY_MAX_W_M2_SR,
            "CITY_BRIGHTEST": CITY_BRIGHTEST,
            "GROUND_MU_MIN": GROUND_MU_MIN,
            "GROUND_SAMPLES": GROUND_SAMPLES,
            **TABLE_DEFINES,
        }

    def draw(self, frame: EarthFrame, draws: Iterable[tuple[EarthDraw, Callable[[], Float32Array]]]) -> None:
        """Draw tiles.

        Parameters
        ----------
        frame : EarthFrame
            Resources of the frame.
        draws : iterable of tuple
            Draw calls, each with a function that returns its vertices (K, 2 + 4 n): the tiles' centres [px], and values
            at their corners. The function is called while the driver executes the previous draw call.
        """
        scene, environment = frame.scene, frame.scene.environment
        self._context.blend_func = self._context.ONE, self._context.ONE
        season = map_season(scene)
        textures = self._textures(frame.images, self.air(environment).frame) | self.ground_textures(season)
        detail = None
        if scene.quality == "high":
            textures["t_terrain"], detail = self._textures_of_high()
        if any(kind.icy or kind.bright_water for kind in frame.tiles.centers_px):
            textures |= self._waters(ice_day(scene))
        if (drawn_rect := frame.tiles.bounds(covered=False)) is not None:
            frame.images.mark_drawn(drawn_rect)
        for draw, get_vertices in draws:
            # binding large textures that the previous draw did not use may make the driver wait for it
            flush(self._context)
            draw_to(draw.framebuffer)
            # whole tiles, beyond the image's edge too: a point whose centre is outside would be dropped
            draw.framebuffer.viewport = draw.viewport
            # The Earth is the first part of the sky to be drawn. Where nothing is in front, it is written, which is
            # cheaper than blending.
            blend = self._context.BLEND if draw.blended else self._context.NOTHING
            self._context.enable_only(blend | self._context.PROGRAM_POINT_SIZE)
            min_filter = self._context.LINEAR if draw.level is None else self._context.LINEAR_MIPMAP_LINEAR
            for texture in self._maps:
                texture.filter = min_filter, self._context.LINEAR
            program, level = draw.program, draw.level or 0.0
            lamps = {} if draw.city is None else {"t_city": draw.city}
            program.bind_textures(**textures, **lamps, t_detail=detail or draw.detail)
            textures = {}  # other programs use the same units
            program.set("u_season", season.share)
            program.set("u_extent_px", frame.tiles.extent_px)
            program.set("u_tile_px", draw.tile_px)
            program.set("u_level", (level - LOG2_TEXEL_KM, level - math.log2(DETAIL_TEXEL_KM), level))
            vertices = get_vertices()
            buffer, array = self._vertex_array(program, vertices.shape[1] - 2)
            buffer.orphan(vertices.nbytes)
            buffer.write(vertices)
            if self._precompiles:
                draw_one_point(array)
            else:
                array.render(vertices=len(vertices))

    def _vertex_array(self, program: Program, values: int) -> tuple[moderngl.Buffer, moderngl.VertexArray]:
        """Return a program's vertex buffer and vertex array: centres of tiles, and values at their four corners."""
        if program not in self._arrays:
            buffer = self._context.buffer(reserve=8, dynamic=True)
            names = [f"in_air_{k}" for k in range(values // 4)]
            array = self._context.vertex_array(
                program.gl,
                [(buffer, " ".join(["2f", *["4f"] * len(names)]), "in_pixel", *names)],
                mode=self._context.POINTS,
            )
            self._arrays[program] = (buffer, array)
        return self._arrays[program]

    def _textures_of_high(self) -> list[moderngl.Texture]:
        """Return the land's fine slopes and the clouds of `high`, uploaded when first needed."""
        if not self._of_high:
            for image in (terrain_texture(), cumulus_texture()):
                self._of_high.append(self._map_texture(mipmap_chain(image, globe=False)))
                self._of_high[-1].repeat_y = True
        return self._of_high

    def _waters(self, day: str) -> dict[str, moderngl.Texture]:
        """Return the maps of sea ice and of the ocean's colour, uploaded when such water is first in view."""
        if not isinstance(self._ocean_colour, moderngl.Texture):
            self._ocean_colour = self._map_texture(self._ocean_colour.result())
        return {"t_ice": self.ice_texture(day), "t_ocean_colour": self._ocean_colour}

    def ice_texture(self, day: str) -> moderngl.Texture:
        """Return the map of a day's sea ice; the last one is cached."""
        if self._ice is None or self._ice[0] != day:
            if self._ice is not None:
                old, self._ice = self._ice[1], None
                release_mipmapped(old)
            self._ice = (day, self._map_texture(mipmap_chain(sea_ice(day), globe=True)))
        return self._ice[1]

    def ground_textures(self, month: Season) -> dict[str, moderngl.Texture]:
        """Return the land's maps, by sampler."""
        maps = dict(zip(("t_map", "t_colour"), self._maps, strict=False))
        return maps | {
            "t_ground_slopes": self._ground_slopes,
            "t_month_before": self._month(month.before),
            "t_month_after": self._month(month.after),
        }

    def _textures(self, images: FrameImages, air: FrameAir) -> dict[str, moderngl.Texture]:
        textures = {"t_coverage": images.coverage, "t_radiance": images.radiance, "t_ground": air.ground}
        if self.bands == 1:
            return textures | {"t_air": air.tables[0]}
        return textures | {
            "t_air_rayleigh": air.tables[0],
            "t_air_mie": air.tables[1],
            "t_air_transmittance": air.tables[2],
        }


EARTH: Resource[Earth] = Resource("earth")


class EarthPass(Pass):
    """Adds ground, clouds and air to the radiance. It is the first pass of the sky."""

    name = "earth.surface"
    reads = (SCENE, EARTH, EARTH_TILES, *IMAGES)
    optional: tuple[Resource[object], ...] = (MOON,)
    writes: tuple[Resource[object], ...] = (RADIANCE,)

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context

    def run(self, r: PassResources) -> None:
        """Draw all tiles."""
        frame, earth = EarthFrame.from_resources(r), r[EARTH]
        tiles = frame.tiles
        draws = []
        for kind, centers in tiles.centers_px.items():
            draw = EarthDraw(
                earth.program(frame, kind, quads=False),
                frame.images.sky_framebuffer,
                (0, 0, *tiles.extent_px),
                kind.covered,
                float(tiles.size_px),
                earth.detail.mipmapped(self._context.LINEAR_MIPMAP_LINEAR),
                earth.night.mipmapped(self._context.LINEAR_MIPMAP_LINEAR) if kind.night else None,
                kind.level,
            )
            draws.append((draw, partial(np.asarray, centers)))
        earth.draw(frame, draws)
