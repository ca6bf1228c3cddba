"""The way of a software driver: what Python finds need not be drawn is left out, and smooth light is interpolated.

Such a driver takes a fraction of the time then; a GPU would wait for Python.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from simulator.render.drawing import earth_frame
from simulator.render.earth.earth_pass import ice_day
from simulator.render.frame_graph import Pass, Resource
from simulator.render.frame_resources import (
    AIR_TABLES,
    COVERAGE,
    EARTH,
    EARTH_PASS,
    EARTH_TILES,
    MODEL,
    MOON,
    PICTURE,
    RADIANCE,
    SAMPLES,
    SCENE,
    SHADOW,
    STARLIGHT,
    TARGET,
    TARGET_LIGHT,
    TARGET_TILES,
)
from simulator.render.projection import PixelRect
from simulator.render.software.coverage_mask import target_tiles
from simulator.render.software.flat_varyings import rewriter
from simulator.render.software.quad_packing import QuadPackingPass, worth_packing
from simulator.render.software.smooth_earth import CornerAir, SmoothEarthPass
from simulator.render.software.smooth_shading import (
    SmoothShadingPass,
    SmoothTiles,
    is_curved,
    is_smooth,
    split_tiles,
)
from simulator.render.software.tiles import earth_tiles
from simulator.render.target.visible_triangles import CulledVertexArray
from simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.render.device import Device
    from simulator.render.frame_graph import PassResources
    from simulator.render.target.viewport_fit import ViewportFit
    from simulator.runtime.arrays import FloatArray
    from simulator.targets.model import Target

EDGE_FREE_TILES: Resource[FloatArray] = Resource("edge-free tiles")
"""(K, 2) centres of the target's tiles that no edge comes near."""
SMOOTH_TILES: Resource[SmoothTiles] = Resource("smooth tiles")
CORNER_AIR: Resource[CornerAir] = Resource("corner air")
QUADS: Resource[bool] = Resource("quads")
"""There where the Earth's smooth tiles are drawn four pixels to a texel."""


class TileCulling:
    """Triangles that face the camera and are not hidden by large bodies; tiles that the craft's hulls touch."""

    mesh_array = CulledVertexArray

    def target_tiles(self, place: ViewportFit) -> FloatArray:
        """Centres (K, 2) [px] of the tiles that the target may touch."""
        return target_tiles(place)

    def outline_px(self, place: ViewportFit, tiles_px: FloatArray) -> FloatArray:  # noqa: ARG002
        """The tiles themselves."""
        return tiles_px


class SoftwarePath:
    """Implements `simulator.render.drawing_path.DrawingPath` for drivers that draw on the processor's own cores."""

    culling = TileCulling()
    earth_pass = SmoothEarthPass
    smooth_moon = True

    def __init__(self, device: Device) -> None:
        device.programs.rewrite = rewriter(device.context)
        self._device = device
        self._smooth = SmoothShadingPass(device.context, device.programs)
        self._quads = QuadPackingPass(device.context, device.programs)
        self._traits: dict[str, tuple[bool, bool]] = {}  # of targets, whether they are smooth and curved
        self._filled = False  # by the Earth, in the last frame: nothing is to be cleared early

    def adapt(self, passes: Sequence[Pass]) -> list[Pass]:
        """Sort tiles, interpolate smooth light, pack pixels, and clear images only where needed."""
        adapted = [self._adapted(one) for one in passes]
        _insert_after(
            adapted,
            "target.edges",
            Pass(
                "target.edge_free_tiles",
                self._find_edge_free_tiles,
                reads=(SCENE, MODEL, TARGET, TARGET_TILES),
                writes=(TARGET_TILES, EDGE_FREE_TILES),
            ),
        )
        _insert_after(
            adapted,
            "target.light",
            Pass(
                "target.smooth_corners",
                self._shade_corners,
                reads=(SCENE, MODEL, TARGET, TARGET_TILES, SAMPLES, SHADOW, TARGET_LIGHT, EDGE_FREE_TILES),
                writes=(TARGET_TILES, SMOOTH_TILES),
            ),
        )
        _insert_after(
            adapted,
            "target.shading",
            Pass(
                "target.smooth_fill",
                self._fill_smooth_tiles,
                reads=(TARGET, RADIANCE, COVERAGE),
                optional=(SMOOTH_TILES,),
                writes=(RADIANCE, COVERAGE),
                submits=True,
            ),
        )
        _insert_after(
            adapted,
            "sun",
            Pass(
                "earth.quad_packing",
                self._pack_quads,
                reads=(QUADS, EARTH_TILES, RADIANCE),
                writes=(QUADS,),
            ),
        )
        names = [one.name for one in adapted]
        if "clear" in names and "earth.air" in names:
            clear = names.index("clear")
            adapted[clear] = replace(adapted[clear], run=self._clear_early)
            _insert_after(
                adapted,
                "earth.air",
                Pass(
                    "clear.rest",
                    self._clear_the_rest,
                    reads=(RADIANCE, COVERAGE),
                    optional=(EARTH, EARTH_TILES),
                    writes=(RADIANCE, COVERAGE),
                ),
            )
        return adapted

    def _adapted(self, one: Pass) -> Pass:
        """A pass of the plain path in this path's way."""
        if one.name == "earth.tiles":
            return replace(one, run=self._sort_tiles, optional=(TARGET,))
        if one.name == "earth.air":
            return replace(one, run=self._look_through_air, optional=(MOON,), writes=(AIR_TABLES, CORNER_AIR))
        if one.name == "earth.surface":
            return replace(
                one,
                run=self._draw_earth,
                optional=(*one.optional, CORNER_AIR),
                writes=(RADIANCE, QUADS),
            )
        if one.name == "target.shading":
            return replace(one, submits=False)  # the driver is told with the smooth tiles
        if one.name == "readback":
            return replace(one, run=self._read_picture, optional=(*one.optional, QUADS))
        return one

    # clearing

    def _clear_early(self, r: PassResources) -> None:
        """Empty the images while the first pass is prepared, where that was right before."""
        images = self._device.images_for(r[SCENE])
        if not self._filled:
            images.clear(PixelRect(0, 0, *images.size))
        r[RADIANCE] = r[COVERAGE] = images

    def _clear_the_rest(self, r: PassResources) -> None:
        """Empty what was not: an Earth that fills the image is written to all pixels but the target's."""
        earth, tiles, images = r.find(EARTH), r.find(EARTH_TILES), r[RADIANCE]
        fills = earth is not None and earth.fills_image
        if self._filled:
            everything = PixelRect(0, 0, *images.size)
            images.clear(tiles.holding(covered=True) if fills and tiles is not None else everything)
        self._filled = fills

    # the target

    def _traits_of(self, target: Target) -> tuple[bool, bool]:
        if target.sha256 not in self._traits:
            self._traits[target.sha256] = is_smooth(target), is_curved(target)
        return self._traits[target.sha256]

    def _find_edge_free_tiles(self, r: PassResources) -> None:
        """Part the target's tiles by whether an edge comes near."""
        scene, target = r[SCENE], r[TARGET]
        may_be_smooth = scene.quality != "high" and target.place.hull_px is not None and not scene.has_lamps
        if not may_be_smooth or not self._traits_of(r[MODEL])[0]:
            return
        seen, edges = target.drawn.edges.seen, len(target.loaded.seen.edges.ends)
        r[TARGET_TILES], edge_free = split_tiles(r[TARGET_TILES], seen, target.edge_view, edges)
        r[EDGE_FREE_TILES] = edge_free if len(edge_free) else None

    def _shade_corners(self, r: PassResources) -> None:
        """Shade edge-free tiles at their corners; those whose light bends in between are shaded pixel by pixel."""
        scene, target, samples, light = r[SCENE], r[TARGET], r[SAMPLES], r[TARGET_LIGHT]
        bands, shadow = len(bands_of(scene.bands)), r[SHADOW]
        program = self._smooth.program(
            target.lattice,
            bands,
            target.loaded.mesh,
            shadow.choice.window,
            curved=self._traits_of(r[MODEL])[1],
        )
        program.set("u_stamp", samples.stamp)
        textures = {
            **samples.textures,
            "t_shadow": shadow.map,
            "t_sky_visibility": light.visibility,
            "t_interreflection": light.interreflection,
        }
        r[SMOOTH_TILES] = tiles = self._smooth.shade_corners(r[EDGE_FREE_TILES], program, textures, bands)
        r[TARGET_TILES] = np.concatenate([r[TARGET_TILES], tiles.others_px])

    def _fill_smooth_tiles(self, r: PassResources) -> None:
        """Interpolate the light between the corners of smooth tiles."""
        tiles, images = r.find(SMOOTH_TILES), r[RADIANCE]
        if tiles is not None:
            self._smooth.fill(tiles, images.target_framebuffer, r[TARGET].rect, images.bands)

    # the Earth

    def _sort_tiles(self, r: PassResources) -> None:
        """Cut what the Earth touches into tiles by what their pixels see."""
        scene, earth, target = r[SCENE], r[EARTH], r.find(TARGET)
        if earth.rect is not None:
            target_px = None if target is None else target.tiles_px
            r[EARTH_TILES] = earth_tiles(earth, scene.camera, target_px, ice_day(scene))

    def _look_through_air(self, r: PassResources) -> None:
        """Draw this frame's air tables if any pixel asks for them, and work out the air at smooth tiles' corners."""
        earth, tiles, moon = r[EARTH], r[EARTH_TILES], r.find(MOON)
        air = r[EARTH_PASS].air(r[SCENE].environment.atmosphere_thickness_km).frame
        # a view of nothing but smooth ground asks for the air at its tiles' corners only
        corners_do = tiles.all_smooth and earth.sky_rows is None
        if not corners_do or (moon is not None and moon.in_front):
            air.run(earth)
            r[AIR_TABLES] = air.tables
        r[CORNER_AIR] = CornerAir.of(tiles, air)

    def _draw_earth(self, r: PassResources) -> None:
        """Add ground, clouds and air, smooth tiles four pixels to a texel where there are many."""
        frame = earth_frame(r)
        quads = worth_packing(frame.images, frame.tiles) and not frame.moon_in_front
        earth_pass = cast("SmoothEarthPass", r[EARTH_PASS])
        earth_pass.run_smooth(frame, r.find(CORNER_AIR), quads=quads)
        r[QUADS] = quads or None

    def _pack_quads(self, r: PassResources) -> None:
        """Pack the pixels that were drawn one by one."""
        self._quads.run(r[RADIANCE], r[EARTH_TILES], r[EARTH_TILES].others_px)

    def _read_picture(self, r: PassResources) -> None:
        """Wait for the driver and take the picture, unpacked."""
        radiance = r[RADIANCE].read_radiance(quads=r.find(QUADS) is not None)
        starlight = r.find(STARLIGHT)
        if starlight is not None:
            starlight.add_to(radiance)
        r[PICTURE] = radiance


def _insert_after(passes: list[Pass], name: str, new: Pass) -> None:
    """Put a pass after the one of some name, if there is one."""
    names = [one.name for one in passes]
    if name in names:
        passes.insert(names.index(name) + 1, new)
