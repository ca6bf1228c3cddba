"""The Moon drawn in smooth tiles, whose ground is interpolated between the corners."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.earth.screen_tiles import tile_size_px
from flyaround.simulator.render.moon.moon_pass import MoonPass, MoonTiles, grid_triangles
from flyaround.simulator.render.moon.moon_view import MOON
from flyaround.simulator.render.projection import directions
from flyaround.simulator.render.software.tiles import MAX_GROUND_EXTENT, MIN_POLE_DISTANCE_TILES
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.world.constants import MOON_RADIUS_M

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.moon.moon_view import MoonView
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import BoolArray

_MIN_SMOOTH_COSINE2 = 0.08  # smallest squared cosine of the angle between ray and vertical at the ground


class SmoothMoonPass(MoonPass):
    """Adds the Moon, interpolating the ground between the corners of tiles except in `high`."""

    def _tiles(self, r: PassResources, rect: PixelRect) -> list[MoonTiles]:
        if r[SCENE].quality == "high":
            return super()._tiles(r, rect)
        target = r.find(TARGET)
        return moon_tiles(r[MOON], rect, r[SCENE].camera, None if target is None else target.rect)


def moon_tiles(moon: MoonView, rect: PixelRect, camera: Camera, target: PixelRect | None) -> list[MoonTiles]:
    """Divide the Moon's rectangle into smooth tiles and others (limb, poles, seams of the map and the craters).

    Parameters
    ----------
    moon : MoonView
        Moon in the image.
    rect : PixelRect
        Rectangle of the Moon in the image.
    camera : Camera
        The camera.
    target : PixelRect or None
        Pixels that the target may touch.
    """
    size = tile_size_px(camera)
    x_px = np.append(np.arange(rect.x0, rect.x1, size), rect.x1) - 0.5
    y_px = np.append(np.arange(rect.y0, rect.y1, size), rect.y1) - 0.5
    d = directions(camera, x_px, y_px, moon.moon_from_camera)
    along_camera = d @ moon.camera
    disc = 1 - (float(moon.camera @ moon.camera) - along_camera**2)
    depth = np.sqrt(np.maximum(disc, 0))
    distance = -along_camera - depth
    x, y, z = (moon.camera[k] + distance * d[..., k] for k in range(3))
    tile_extent = distance * size * camera.pixel_angle_rad()
    clear_of_seam = np.abs(moon.camera[0] * y - moon.camera[1] * x) > 2 * tile_extent * np.hypot(
        *moon.camera[:2]
    )
    is_smooth_corner = clear_of_seam | (moon.camera[0] * x + moon.camera[1] * y > 0)
    largest = np.minimum(MAX_GROUND_EXTENT * depth, np.hypot(x, y) / MIN_POLE_DISTANCE_TILES)
    is_smooth_corner &= (along_camera < 0) & (disc > _MIN_SMOOTH_COSINE2) & (tile_extent < largest)
    smooth = _all_corners(is_smooth_corner) & (_all_corners(z > 0) | _all_corners(z < 0))
    covered = np.zeros_like(smooth)
    if target is not None:
        rows, columns = (
            (edges[1:] > low) & (edges[:-1] < high - 1)
            for edges, low, high in ((y_px, target.y0, target.y1), (x_px, target.x0, target.x1))
        )
        covered = rows[:, None] & columns
    triangles = grid_triangles(x_px, y_px)
    # the footprint grows towards the limb, where the ground is foreshortened
    footprint = distance * camera.pixel_angle_rad() * (MOON_RADIUS_M * 1e-3) / np.sqrt(np.fmax(depth, 0.02))
    largest = float(np.max(footprint, initial=0.0, where=is_smooth_corner))
    kinds = (
        MoonTiles(triangles[~smooth].reshape(-1, 2)),
        MoonTiles(triangles[smooth & ~covered].reshape(-1, 2), True, False, largest, size),
        MoonTiles(triangles[smooth & covered].reshape(-1, 2), True, True, largest, size),
    )
    return [kind for kind in kinds if len(kind.triangles_px)]


def _all_corners(values: BoolArray) -> BoolArray:
    return values[:-1, :-1] & values[:-1, 1:] & values[1:, :-1] & values[1:, 1:]
