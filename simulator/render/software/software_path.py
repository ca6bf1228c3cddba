"""The way of a software driver: what Python finds need not be drawn is left out, and smooth light is interpolated.

Such a driver takes a fraction of the time then; a GPU would wait for Python.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np

from flyaround.simulator.render.craft.viewport_fit import TILE_PX, all_tiles, tile_centers
from flyaround.simulator.render.craft.visible_triangles import CulledVertexArray
from flyaround.simulator.render.drawing import earth_frame
from flyaround.simulator.render.earth.earth_pass import ice_day
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.frame_resources import (
    AIR_TABLES,
    COVERAGE,
    EARTH_PASS,
    EARTH_TILES,
    GLOBE,
    MOON,
    PICTURE,
    RADIANCE,
    SCENE,
    STARLIGHT,
    TARGET,
)
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.software.flat_varyings import rewriter
from flyaround.simulator.render.software.quad_packing import QuadPackingPass, worth_packing
from flyaround.simulator.render.software.smooth_earth import CornerAir, SmoothEarthPass
from flyaround.simulator.render.software.tiles import earth_tiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

CORNER_AIR: Resource[CornerAir] = Resource("corner air")
QUADS: Resource[bool] = Resource("quads")
"""There where the Earth's smooth tiles are drawn four pixels to a texel."""
_MASK_PX = 2  # of the picture that the hulls are filled into
_FOUR_BYTES = np.uint32  # a tile's row there
_SHIFT = 4  # bits of a corner's fraction there
_AROUND = np.ones((3, 3), np.uint8)
_FARTHEST = 1 << 14  # OpenCV's corners must fit in whole numbers with the fraction's bits to spare


class TileCulling:
    """Triangles that face the camera and are not hidden by large bodies; tiles that the craft's hulls touch.

    Triangles left out are worth 69 ms of 800, of those and of edges the ones that large bodies hide 44.
    """

    mesh_array = CulledVertexArray

    def target_tiles(self, place: ViewportFit) -> FloatArray:
        """Centres (K, 2) [px] of the tiles that the target may touch; all of its rectangle, if part of it is behind."""
        if place.hull_px is None:
            return all_tiles(place.rect)
        return hull_tiles(place.rect, place.hull_px, place.hull_parts)


def hull_tiles(rect: PixelRect, points_px: FloatArray, parts: IntArray) -> FloatArray:
    """Centres (K, 2) [px] of the tiles of a rectangle that some convex hulls touch, and a few more.

    The craft is the union of its parts, and each part lies in its convex hull; the hulls' pictures, filled one over the
    other, hold the craft's closely: antennas and panels leave open what is between them. Worth 53 ms of 800.

    Parameters
    ----------
    rect : begins at whole tiles. points_px : (2, K) projected points of all hulls, one hull after the other.
    parts : where the points of the second hull begin, of the third and so on.
    """
    rows, columns = -(-rect.height // TILE_PX), -(-rect.width // TILE_PX)
    step = TILE_PX // _MASK_PX
    # one more on each side: what ends there may touch a pixel inside
    mask = np.zeros((rows * step + 2, columns * step + 2), np.uint8)
    # mask pixel (1, 1) is the mean of image pixels x0 and x0 + 1
    fixed = np.empty((points_px.shape[1], 2), np.int32)
    for axis, first in enumerate((rect.x0, rect.y0)):
        at = (points_px[axis] - (first + 0.5 * (_MASK_PX - 1) - _MASK_PX)) / _MASK_PX
        fixed[:, axis] = np.rint(np.minimum(np.maximum(at, -_FARTHEST), _FARTHEST) * (1 << _SHIFT))
    ends = [0, *parts.tolist(), len(fixed)]
    for start, end in itertools.pairwise(ends):
        cv2.fillConvexPoly(mask, cv2.convexHull(fixed[start:end]), 1, shift=_SHIFT)
    # a pixel whose corner is touched counts, and OpenCV's fill leaves out what it touches by less than half
    cv2.dilate(mask, _AROUND, dst=mask)
    inner = mask[1:-1, 1:-1].reshape(rows, step, -1).max(axis=1)  # one axis after the other is quicker
    return tile_centers(inner.view(_FOUR_BYTES) != 0, rect)


class SoftwarePath:
    """Implements `render.drawing_path.DrawingPath` for drivers that draw on the processor's own cores."""

    culling = TileCulling()
    earth_pass = SmoothEarthPass
    smooth_moon = True

    def __init__(self, device: Device) -> None:
        device.programs.rewrite = rewriter(device.context)
        self._device = device
        self._quads = QuadPackingPass(device.context, device.programs)
        self._filled = False  # by the Earth, in the last frame: nothing is to be cleared early

    def adapt(self, passes: Sequence[Pass]) -> list[Pass]:
        """Sort the Earth's tiles, pack pixels, and clear images only where needed."""
        adapted = [self._adapted(one) for one in passes]
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
                    optional=(GLOBE, EARTH_TILES),
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
        earth, tiles, images = r.find(GLOBE), r.find(EARTH_TILES), r[RADIANCE]
        written = tiles if earth is not None and earth.fills_image else None
        if self._filled:
            everything = PixelRect(0, 0, *images.size)
            images.clear(everything if written is None else written.holding(covered=True))
        self._filled = written is not None

    # the Earth

    def _sort_tiles(self, r: PassResources) -> None:
        """Cut what the Earth touches into tiles by what their pixels see."""
        scene, earth, target = r[SCENE], r[GLOBE], r.find(TARGET)
        if earth.rect is not None:
            target_px = None if target is None else target.tiles_px
            r[EARTH_TILES] = earth_tiles(earth, scene.camera, target_px, ice_day(scene))

    def _look_through_air(self, r: PassResources) -> None:
        """Draw this frame's air tables if any pixel asks for them, and work out the air at smooth tiles' corners."""
        earth, tiles, moon = r[GLOBE], r[EARTH_TILES], r.find(MOON)
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
