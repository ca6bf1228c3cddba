"""The passes for a software driver, which draws on the CPU.

What is hidden is culled in Python before it is drawn, and light that varies smoothly is interpolated across tiles.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.render.craft.viewport_fit import TILE_PX, all_tiles, tile_centers
from flyaround.simulator.render.craft.visible_triangles import CulledVertexArray
from flyaround.simulator.render.earth.earth_view import GlobeViewPass
from flyaround.simulator.render.earth.screen_tiles import EARTH_TILES
from flyaround.simulator.render.frame_graph import Pass
from flyaround.simulator.render.frame_images import COVERAGE, IMAGES, RADIANCE, ClearPass
from flyaround.simulator.render.frame_passes import FramePasses
from flyaround.simulator.render.globe.globe_pass import GlobeAirPass, GlobePass
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.moon.moon_view import MoonViewPass
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.sky.star_pass import StarPass
from flyaround.simulator.render.sky.sun_pass import SunPass
from flyaround.simulator.render.software.quad_packing import QuadPackingPass, ReadQuadsPass
from flyaround.simulator.render.software.smooth_earth import CornerAirPass, SmoothEarthPass
from flyaround.simulator.render.software.smooth_moon import SmoothMoonPass
from flyaround.simulator.render.software.tiles import SortedTilesPass
from flyaround.simulator.render.view import SCENE

if TYPE_CHECKING:
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.earth.earth_view import Earths
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

_MASK_PX = 2  # side of a mask pixel [px]; a tile is four of them wide
_FOUR_BYTES = np.uint32  # four mask pixels read as one number
_SHIFT = 4  # fractional bits of OpenCV's fixed-point coordinates
_NEIGHBOURHOOD = np.ones((3, 3), np.uint8)  # a pixel and its eight neighbours
# coordinates are clipped to this, so that with the fractional bits they fit OpenCV's integers
_MAX_CORNER_PX = 1 << 14


class TileCulling:
    """Selects triangles that may be visible, and tiles that the convex hulls of the target's parts touch."""

    mesh_array = CulledVertexArray

    def target_tiles(self, fit: ViewportFit) -> FloatArray:
        """Return centres (K, 2) [px] of the tiles that the target may touch.

        If part of the target is behind the camera, these are all tiles of its rectangle.
        """
        if fit.hull_px is None:
            return all_tiles(fit.rect)
        return hull_tiles(fit.rect, fit.hull_px, fit.hull_parts)


def hull_tiles(rect: PixelRect, points_px: FloatArray, parts: IntArray) -> FloatArray:
    """Return centres (M, 2) [px] of the tiles of a rectangle that convex hulls touch, and a few more.

    Each part of the target lies in its convex hull, so the union of the projected hulls bounds the target's pixels. It
    is a tight bound: space between antennas and panels stays outside.

    Parameters
    ----------
    rect : PixelRect
        Rectangle that begins at whole tiles.
    points_px : (2, K) array
        Projected points of all hulls in turn [px].
    parts : array
        Index of the first point of each hull but the first.
    """
    rows, columns = -(-rect.height // TILE_PX), -(-rect.width // TILE_PX)
    step = TILE_PX // _MASK_PX
    # a border of one mask pixel, because a hull that ends there may touch a pixel inside
    mask = np.zeros((rows * step + 2, columns * step + 2), np.uint8)
    # mask pixel (1, 1) is the mean of image pixels x0 and x0 + 1
    fixed_point = np.empty((points_px.shape[1], 2), np.int32)
    for axis, first in enumerate((rect.x0, rect.y0)):
        coordinate = (points_px[axis] - (first + 0.5 * (_MASK_PX - 1) - _MASK_PX)) / _MASK_PX
        fixed_point[:, axis] = np.rint(
            np.minimum(np.maximum(coordinate, -_MAX_CORNER_PX), _MAX_CORNER_PX) * (1 << _SHIFT)
        )
    bounds = [0, *parts.tolist(), len(fixed_point)]
    for start, end in itertools.pairwise(bounds):
        cv2.fillConvexPoly(mask, cv2.convexHull(fixed_point[start:end]), 1, shift=_SHIFT)
    # grow by one mask pixel, because OpenCV's fill omits pixels that are covered by less than half
    cv2.dilate(mask, _NEIGHBOURHOOD, dst=mask)
    # reduce rows with max, then columns by reading four bytes as one number: faster than one reduction over both
    inner = mask[1:-1, 1:-1].reshape(rows, step, -1).max(axis=1)
    return tile_centers(inner.view(_FOUR_BYTES) != 0, rect)


class EarlyClearPass(ClearPass):
    """Clears the images at the start of the frame, unless the Earth filled the last frame.

    An Earth that fills the image overwrites all pixels, so most likely they need no clearing. If it does not fill this
    frame, `ClearRestPass` clears them later.
    """

    earth_filled_image = False
    """True if the Earth filled the last frame."""

    def run(self, r: PassResources) -> None:
        """Clear the images, unless the Earth filled the last frame."""
        if self.earth_filled_image:
            r[RADIANCE] = r[COVERAGE] = self._images_for(r[SCENE])
        else:
            super().run(r)


class ClearRestPass(Pass):
    """Clears the pixels that `EarlyClearPass` left and that the Earth will not overwrite."""

    name = "clear.rest"
    reads = IMAGES
    optional = (GLOBE, EARTH_TILES)
    writes = IMAGES

    def __init__(self, early: EarlyClearPass) -> None:
        self._early = early

    def run(self, r: PassResources) -> None:
        """Clear the remaining pixels: all, or those that the target may cover if the Earth fills the image."""
        earth, tiles, images = r.find(GLOBE), r.find(EARTH_TILES), r[RADIANCE]
        overwriting = tiles if earth is not None and earth.fills_image else None
        if self._early.earth_filled_image:
            whole_image = PixelRect(0, 0, *images.size)
            images.clear(whole_image if overwriting is None else overwriting.bounds(covered=True))
        self._early.earth_filled_image = overwriting is not None


def software_passes(device: Device, earths: Earths) -> FramePasses:
    """Return the passes for a software driver."""
    clear, earth = EarlyClearPass(device.images_for), SmoothEarthPass(device.context)
    view_passes = (MoonViewPass(device.blocks.moon), SortedTilesPass(), CornerAirPass())
    return FramePasses(
        device,
        earths,
        TileCulling(),
        clear=clear,
        globe=GlobeViewPass(device, earths),
        views=(*view_passes, ClearRestPass(clear), GlobeAirPass()),
        sky=(
            earth,
            GlobePass(device),
            StarPass(device),
            SmoothMoonPass(device),
            SunPass(device),
            QuadPackingPass(device),
        ),
        earth_programs=(*view_passes, earth),
        read_back=ReadQuadsPass(),
    )
