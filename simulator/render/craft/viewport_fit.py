"""Viewport fit: pixels and tiles that a target may touch, its depth range and its sampling density."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.lens_bend import bent_outlines, longest_edge_m
from flyaround.simulator.render.craft.sample_pattern import SEVEN, SamplePattern, rotated
from flyaround.simulator.render.projection import PixelRect, image_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray
    from flyaround.simulator.scene.state import Quality

TILE_PX = 8
"""Side of the screen tiles in which the target's pixels are shaded."""
MIN_NEAR_M = 0.01  # the camera cannot be closer than its own lens
# lattices to try in order, and the largest buffer [samples] of each
PATTERNS: dict[str, tuple[tuple[SamplePattern, float], ...]] = {
    "draft": ((rotated(2), np.inf),),
    "default": ((SEVEN, 16e6), (rotated(2), np.inf)),
    "high": (
        (rotated(8), 6e6),
        (rotated(6), 9e6),
        (rotated(5, 2), 15e6),
        (rotated(4), 45e6),
        (rotated(3, 2), np.inf),
    ),
}
# Below this pixel width on the craft [m] the default preset takes five samples. Seven are for gaps between solar cells,
# 0.8 to 4 mm wide: five draw them dashed if they are a third of a pixel wide, and correctly from one pixel on.
NEAR_PIXEL_M = 1e-3
DENSE_PATTERNS = ((rotated(4), 10e6), (rotated(3), 22e6), (rotated(2), np.inf))
TINY_PX = 22  # a smaller target gets the finest lattice, because few pixels hold all its light
TILE_REACH_PX = (TILE_PX - 1) / 2
TINY_PATTERN = rotated(8)  # 65 samples per pixel


@dataclass(frozen=True, eq=False)
class ViewportFit:
    """The target's place in the image: bounds (not clipped), pixels to draw, depth range.

    The pixels to draw begin at whole tiles, and end there or at the image's edge. ``hull_px``: (2, K) corners of the
    parts' hulls in the image, bent by the lens, if all of them is in front of the camera; ``hull_parts``: start of each
    hull but the first. ``nearest_m``: least camera z of the mesh; the depth range is that of its sphere. ``longest_m``:
    longest edge that the lens does not bend visibly.
    """

    bounds_px: FloatArray
    rect: PixelRect
    near_far_m: tuple[float, float]
    camera_from_target: FloatArray
    nearest_m: float
    hull_parts: IntArray
    hull_px: FloatArray | None = None
    longest_m: float = np.inf

    @property
    def is_cut(self) -> bool:
        """True if part of the target may be nearer than the near plane."""
        return self.near_far_m[0] <= MIN_NEAR_M

    def pixel_m(self, camera: Camera) -> float:
        """Return the width of a pixel at the nearest point of the mesh [m]."""
        return self.nearest_m / max(camera.fx_px, camera.fy_px)

    @property
    def camera_target_m(self) -> FloatArray:
        """Position of the camera in the target frame [m]."""
        return np.asarray(-self.camera_from_target[:3, :3].T @ self.camera_from_target[:3, 3])


def all_tiles(rect: PixelRect) -> FloatArray:
    """Return centres (K, 2) [px] of all the tiles of a rectangle that begins at whole tiles."""
    return tile_centers(np.ones((-(-rect.height // TILE_PX), -(-rect.width // TILE_PX)), bool), rect)


def tile_centers(tiles: BoolArray, rect: PixelRect) -> FloatArray:
    """Return centres (K, 2) [px] of the tiles (rows, columns) of a rectangle that are True."""
    row, column = np.nonzero(tiles)
    middle = (TILE_PX - 1) / 2
    centers = np.empty((len(row), 2))
    centers[:, 0] = column * TILE_PX + (rect.x0 + middle)
    centers[:, 1] = row * TILE_PX + (rect.y0 + middle)
    return centers


def matrix_of(R: FloatArray, t_m: ArrayLike) -> FloatArray:
    """Return the (4, 4) matrix of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t_m
    return matrix


def fit_viewport(
    mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, *, clip: bool = True
) -> ViewportFit | None:
    """Fit the viewport to the target; ``None`` if none of it is in front of the camera (and, clipped, in the image).

    A target that reaches behind the camera gets twice the image's size on each side.
    """
    R, t = camera_from_target[:3, :3], camera_from_target[:3, 3]
    z = float(R[2] @ mesh.center_m + t[2])
    near, far = max(z - mesh.radius_m * 1.001, MIN_NEAR_M), z + mesh.radius_m * 1.001
    if far <= MIN_NEAR_M:
        return None
    width, height = camera.width_px, camera.height_px
    points = R @ mesh.hull_m + t[:, None]
    hull_px, parts, nearest = None, mesh.hull_parts, max(float(points[2].min()), near)
    if nearest > MIN_NEAR_M:
        if not camera.distortion.is_none:
            points, parts = bent_outlines(camera, points, parts)
        hull_px = np.stack(image_of(camera, *(points[:2] / points[2])))
        bounds = np.concatenate([hull_px.min(axis=1), hull_px.max(axis=1)])
    else:
        bounds = np.array([-width, -height, 2.0 * width, 2.0 * height])
    limit = np.array([-width, -height, 2 * width, 2 * height]) * (1 if clip else 100)
    low = np.floor(np.clip(bounds[:2] - 0.5, limit[:2], limit[2:])).astype(int)
    high = np.ceil(np.clip(bounds[2:] + 0.5, limit[:2], limit[2:])).astype(int) + 1
    if clip:
        low, high = np.maximum(low, 0), np.minimum(high, [width, height])
        if np.any(high <= low):
            return None
        low, high = low // TILE_PX * TILE_PX, np.minimum(-(-high // TILE_PX) * TILE_PX, [width, height])
    rect = PixelRect(int(low[0]), int(low[1]), int(high[0]), int(high[1]))
    longest = longest_edge_m(mesh, camera_from_target, camera, rect)
    return ViewportFit(bounds, rect, (near, far), camera_from_target, nearest, parts, hull_px, longest)


def outline_px(place: ViewportFit) -> FloatArray:
    """Return (K, 2) points [px] that span the target's pixels: corners of its hulls, or else centres of all tiles."""
    if place.hull_px is None:
        return all_tiles(place.rect)
    rect = place.rect
    return np.clip(place.hull_px.T, [rect.x0, rect.y0], [rect.x1 - 1, rect.y1 - 1])


def choose_pattern(
    quality: Quality, place: ViewportFit, tiles_px: FloatArray, pixel_m: float, *, dense: bool = False
) -> SamplePattern:
    """Return the finest lattice of the preset whose buffer stays within its limit.

    Parameters
    ----------
    tiles_px : (K, 2) array
        Centres of the tiles that the target may touch, or its outline.
    pixel_m : float
        Width of a pixel at the nearest point of the target [m].
    dense : bool, optional
        True for more samples, for textures, inside which no edges weight them.
    """
    if np.max(place.bounds_px[2:] - place.bounds_px[:2]) <= TINY_PX:
        return TINY_PATTERN
    if quality == "default" and not dense and pixel_m <= NEAR_PIXEL_M:
        return rotated(2)
    for lattice, limit in DENSE_PATTERNS if dense and quality == "default" else PATTERNS[quality]:
        width, height = lattice.window(tiles_px, TILE_REACH_PX)[0]
        if width * height <= limit:
            return lattice
    raise AssertionError("the last lattice of a preset has no limit")
