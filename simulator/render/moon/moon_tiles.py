"""Tiles of the Moon: where what a pixel sees of its ground may be interpolated between the corners of a tile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.earth.screen_tiles import tile_size_px
from flyaround.simulator.render.projection import directions
from flyaround.simulator.world.constants import MOON_RADIUS_M

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.moon.moon_view import MoonView
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray

_SMOOTH_DISC = 0.08  # square of the ray's depth under the sphere, 1 at the nadir
_LARGEST_GROUND = 0.015  # of a tile on the ground [radii]
_POLE_SPANS = (
    16  # from a pole to a smooth tile, in its sides: nearer the map's longitude bends by a third of a pixel
)


@dataclass(frozen=True, eq=False)
class MoonTiles:
    """Tiles of the Moon's rectangle that are drawn alike.

    Parameters
    ----------
    triangles_px : (6 K, 2) corners of two of each [px], edges of pixels at .5.
    smooth : their ground may be interpolated between their corners. covered : the target may be in front.
    footprint_km : of the pixel that sees most ground; infinite where that is not known. size_px : side of a tile.
    """

    triangles_px: Float32Array
    smooth: bool = False
    covered: bool = True
    footprint_km: float = float("inf")
    size_px: int = 0


def moon_tiles(moon: MoonView, camera: Camera, target: PixelRect | None) -> list[MoonTiles]:
    """The Moon's rectangle in tiles: smooth ones, and limb, poles, and the equator, where the craters' plane folds.

    Parameters
    ----------
    target : pixels that the target may touch.
    """
    rect = moon.rect
    if rect is None:
        raise ValueError("a Moon that is not in the image has no tiles")
    size = tile_size_px(camera)
    x_px = np.append(np.arange(rect.x0, rect.x1, size), rect.x1) - 0.5
    y_px = np.append(np.arange(rect.y0, rect.y1, size), rect.y1) - 0.5
    d = directions(camera, x_px, y_px, moon.moon_from_camera)
    along = d @ moon.camera
    disc = 1 - (float(moon.camera @ moon.camera) - along**2)
    depth = np.sqrt(np.maximum(disc, 0))
    distance = -along - depth
    x, y, z = (moon.camera[k] + distance * d[..., k] for k in range(3))
    span = distance * size * camera.pixel_angle_rad()
    aside = np.abs(moon.camera[0] * y - moon.camera[1] * x) > 2 * span * np.hypot(*moon.camera[:2])
    even = aside | (moon.camera[0] * x + moon.camera[1] * y > 0)
    largest = np.minimum(_LARGEST_GROUND * depth, np.hypot(x, y) / _POLE_SPANS)
    even &= (along < 0) & (disc > _SMOOTH_DISC) & (span < largest)
    smooth = _all_corners(even) & (_all_corners(z > 0) | _all_corners(z < 0))
    covered = np.zeros_like(smooth)
    if target is not None:
        rows, columns = (
            (e[1:] > low) & (e[:-1] < high - 1)
            for e, low, high in ((y_px, target.y0, target.y1), (x_px, target.x0, target.x1))
        )
        covered = rows[:, None] & columns
    triangles = _triangles(x_px, y_px)
    # larger towards the limb: the ground is seen aslant
    footprint = distance * camera.pixel_angle_rad() * (MOON_RADIUS_M * 1e-3) / np.sqrt(np.fmax(depth, 0.02))
    largest = float(np.max(footprint, initial=0.0, where=even))
    kinds = (
        MoonTiles(triangles[~smooth].reshape(-1, 2)),
        MoonTiles(triangles[smooth & ~covered].reshape(-1, 2), True, False, largest, size),
        MoonTiles(triangles[smooth & covered].reshape(-1, 2), True, True, largest, size),
    )
    return [kind for kind in kinds if len(kind.triangles_px)]


def one_tile(rect: PixelRect) -> MoonTiles:
    """A rectangle as one tile, of which nothing is known."""
    x_px, y_px = np.array([rect.x0, rect.x1]) - 0.5, np.array([rect.y0, rect.y1]) - 0.5
    return MoonTiles(_triangles(x_px, y_px).reshape(-1, 2))


def _triangles(x_px: FloatArray, y_px: FloatArray) -> Float32Array:
    """(rows, columns, 6, 2) corners of the two triangles of each cell of a grid."""
    corners = np.stack(np.meshgrid(x_px, y_px), axis=-1).astype(np.float32)
    first, right, below, across = corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:]
    return np.stack([first, below, right, right, below, across], axis=2)


def _all_corners(values: BoolArray) -> BoolArray:
    return values[:-1, :-1] & values[:-1, 1:] & values[1:, :-1] & values[1:, 1:]
