"""The passes of a software driver: hidden items are culled in Python, and smooth light is interpolated."""

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

_MASK_PX = 2  # pixels of the image per pixel of the mask that the hulls are filled into
_FOUR_BYTES = np.uint32  # one tile's row in the mask
_SHIFT = 4  # bits of the fraction of OpenCV's fixed-point corners
_AROUND = np.ones((3, 3), np.uint8)  # a pixel and its eight neighbours
_FARTHEST = 1 << 14  # corners must fit OpenCV's integers with the fraction's bits to spare


class TileCulling:
    """Selects triangles that face the camera and are not behind large bodies, and tiles that the hulls touch."""

    mesh_array = CulledVertexArray

    def target_tiles(self, place: ViewportFit) -> FloatArray:
        """Return centres (K, 2) [px] of the tiles that the target may touch, all if part of it is behind the camera."""
        if place.hull_px is None:
            return all_tiles(place.rect)
        return hull_tiles(place.rect, place.hull_px, place.hull_parts)


def hull_tiles(rect: PixelRect, points_px: FloatArray, parts: IntArray) -> FloatArray:
    """Return centres (K, 2) [px] of the tiles of a rectangle that some convex hulls touch, and a few more.

    The craft is the union of its parts, and each part lies in its convex hull. The union of the hulls' images is a
    tight bound, which leaves open the space between antennas and panels.

    Parameters
    ----------
    rect : PixelRect
        Rectangle that begins at whole tiles.
    points_px : (2, K) array
        Projected points of all hulls in turn.
    parts : array
        Start of the points of each hull but the first.
    """
    rows, columns = -(-rect.height // TILE_PX), -(-rect.width // TILE_PX)
    step = TILE_PX // _MASK_PX
    # one more on each side: a hull that ends there may touch a pixel inside
    mask = np.zeros((rows * step + 2, columns * step + 2), np.uint8)
    # mask pixel (1, 1) is the mean of image pixels x0 and x0 + 1
    fixed = np.empty((points_px.shape[1], 2), np.int32)
    for axis, first in enumerate((rect.x0, rect.y0)):
        at = (points_px[axis] - (first + 0.5 * (_MASK_PX - 1) - _MASK_PX)) / _MASK_PX
        fixed[:, axis] = np.rint(np.minimum(np.maximum(at, -_FARTHEST), _FARTHEST) * (1 << _SHIFT))
    ends = [0, *parts.tolist(), len(fixed)]
    for start, end in itertools.pairwise(ends):
        cv2.fillConvexPoly(mask, cv2.convexHull(fixed[start:end]), 1, shift=_SHIFT)
    # count a pixel whose corner is touched: OpenCV's fill omits pixels touched by less than half
    cv2.dilate(mask, _AROUND, dst=mask)
    inner = mask[1:-1, 1:-1].reshape(rows, step, -1).max(axis=1)  # one axis after the other is faster
    return tile_centers(inner.view(_FOUR_BYTES) != 0, rect)


class EarlyClearPass(ClearPass):
    """Clears the images while the first pass is prepared, if that was right for the last frame."""

    filled = False
    """True if the Earth filled the last frame: then nothing is cleared early."""

    def run(self, r: PassResources) -> None:
        """Clear, unless the Earth may write all pixels."""
        if self.filled:
            r[RADIANCE] = r[COVERAGE] = self._images_for(r[SCENE])
        else:
            super().run(r)


class ClearRestPass(Pass):
    """Clears the remaining pixels: an Earth that fills the image writes all but the target's."""

    name = "clear.rest"
    reads = IMAGES
    optional = (GLOBE, EARTH_TILES)
    writes = IMAGES

    def __init__(self, early: EarlyClearPass) -> None:
        self._early = early

    def run(self, r: PassResources) -> None:
        """Clear the pixels that the Earth will not write, if nothing was cleared early."""
        earth, tiles, images = r.find(GLOBE), r.find(EARTH_TILES), r[RADIANCE]
        written = tiles if earth is not None and earth.fills_image else None
        if self._early.filled:
            everything = PixelRect(0, 0, *images.size)
            images.clear(everything if written is None else written.holding(covered=True))
        self._early.filled = written is not None


def software_passes(device: Device, earths: Earths) -> FramePasses:
    """Return the passes for a driver that draws on the CPU."""
    clear, earth = EarlyClearPass(device.images_for), SmoothEarthPass(device.context)
    find = (MoonViewPass(device.blocks.moon), SortedTilesPass(), CornerAirPass())
    return FramePasses(
        device,
        earths,
        TileCulling(),
        clear=clear,
        globe=GlobeViewPass(device, earths),
        views=(*find, ClearRestPass(clear), GlobeAirPass()),
        sky=(
            earth,
            GlobePass(device),
            StarPass(device),
            SmoothMoonPass(device),
            SunPass(device),
            QuadPackingPass(device),
        ),
        earth_programs=(*find, earth),
        read_back=ReadQuadsPass(),
    )
