"""Viewport fit: the pixels and tiles that a target may touch, its depth range and its sample lattice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.lens_bend import bent_outlines, longest_edge_m
from flyaround.simulator.render.craft.sample_pattern import SEVEN, SamplePattern, rotated
from flyaround.simulator.render.projection import PixelRect, project_rays

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray
    from flyaround.simulator.scene.state import Quality

TILE_PX = 8
"""Side of the screen tiles in which the target's pixels are shaded."""
MIN_NEAR_M = 0.01
"""Smallest distance of the near plane; nothing comes closer than the lens allows."""
DEPTH_MARGIN = 1.001
"""Factor on the radius between near and far plane, against the rounding of depths."""
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
"""Lattices of each preset in the order in which they are tried, and the largest buffer of each [samples]."""
NEAR_PIXEL_M = 1e-3
"""Width of a pixel on the craft [m] below which the default preset takes five samples instead of seven. Gaps between
solar cells are 0.8 to 4 mm wide: five samples draw them correctly if they are wider than a pixel, but dashed at a third
of a pixel."""
DENSE_PATTERNS = ((rotated(4), 10e6), (rotated(3), 22e6), (rotated(2), np.inf))
TINY_PX = 22
"""Extent of the target in the image up to which it gets the finest lattice, because few pixels hold all its light."""
TILE_REACH_PX = (TILE_PX - 1) / 2  # distance from a tile's middle to its outermost pixel centres [px]
TINY_PATTERN = rotated(8)  # 65 samples per pixel


@dataclass(frozen=True, eq=False)
class ViewportFit:
    """The target's extent in the image and in depth.

    Parameters
    ----------
    bounds_px : (4,) array
        Bounds x0, y0, x1, y1 of the target, not clipped to the image [px].
    rect : PixelRect
        Pixels to draw. They begin at whole tiles, and end at whole tiles or at the image's edge.
    near_far_m : tuple of float
        Camera z range of the target's bounding sphere [m].
    camera_from_target : (4, 4) array
        Homogeneous transform from the target to the camera frame.
    nearest_m : float
        Smallest camera z of the mesh [m].
    hull_parts : array
        Index of the first point of each hull but the first.
    hull_px : (2, K) array, optional
        Projected points of the parts' convex hulls, distorted by the lens; None if some are behind the camera.
    longest_m : float, optional
        Longest edge whose distorted image may be drawn straight [m].
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


def homogeneous_matrix(R: FloatArray, t_m: ArrayLike) -> FloatArray:
    """Return the (4, 4) homogeneous matrix of a rotation (3, 3) and a translation (3,) [m]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t_m
    return matrix


def fit_viewport(
    mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, *, clip: bool = True
) -> ViewportFit | None:
    """Fit the viewport to the target.

    The bounds of a target that reaches behind the camera exceed the image by its own size on each side.

    Parameters
    ----------
    mesh : GpuMesh
        Mesh of the target.
    camera_from_target : (4, 4) array
        Homogeneous transform from the target to the camera frame.
    camera : Camera
        Camera of the scene.
    clip : bool, optional
        True to clip the pixels to the image.

    Returns
    -------
    ViewportFit or None
        None if no part of the target is in front of the camera, or with ``clip`` in the image.
    """
    R, t = camera_from_target[:3, :3], camera_from_target[:3, 3]
    z = float(R[2] @ mesh.center_m + t[2])
    radius_m = mesh.radius_m * DEPTH_MARGIN
    near, far = max(z - radius_m, MIN_NEAR_M), z + radius_m
    if far <= MIN_NEAR_M:
        return None
    width, height = camera.width_px, camera.height_px
    points = R @ mesh.hull_m + t[:, None]
    hull_px, parts, nearest = None, mesh.hull_parts, max(float(points[2].min()), near)
    if nearest > MIN_NEAR_M:
        if not camera.distortion.is_none:
            points, parts = bent_outlines(camera, points, parts)
        hull_px = np.stack(project_rays(camera, *(points[:2] / points[2])))
        bounds = np.concatenate([hull_px.min(axis=1), hull_px.max(axis=1)])
    else:
        bounds = np.array([-width, -height, 2.0 * width, 2.0 * height])
    limit = np.array([-width, -height, 2 * width, 2 * height]) * (1 if clip else 100)
    lowest = np.floor(np.clip(bounds[:2] - 0.5, limit[:2], limit[2:])).astype(int)
    highest = np.ceil(np.clip(bounds[2:] + 0.5, limit[:2], limit[2:])).astype(int) + 1
    if clip:
        lowest, highest = np.maximum(lowest, 0), np.minimum(highest, [width, height])
        if np.any(highest <= lowest):
            return None
        lowest, highest = (
            lowest // TILE_PX * TILE_PX,
            np.minimum(-(-highest // TILE_PX) * TILE_PX, [width, height]),
        )
    rect = PixelRect(int(lowest[0]), int(lowest[1]), int(highest[0]), int(highest[1]))
    longest_m = longest_edge_m(mesh, camera_from_target, camera, rect)
    return ViewportFit(bounds, rect, (near, far), camera_from_target, nearest, parts, hull_px, longest_m)


def outline_px(fit: ViewportFit) -> FloatArray:
    """Return (K, 2) points [px] whose bounds hold the target's pixels: its hulls, or else the centres of all tiles."""
    if fit.hull_px is None:
        return all_tiles(fit.rect)
    rect = fit.rect
    return np.clip(fit.hull_px.T, [rect.x0, rect.y0], [rect.x1 - 1, rect.y1 - 1])


def choose_pattern(
    quality: Quality, fit: ViewportFit, tiles_px: FloatArray, pixel_m: float, *, dense: bool = False
) -> SamplePattern:
    """Return the finest lattice of the preset whose buffer is within its limit.

    Parameters
    ----------
    quality : Quality
        Preset.
    fit : ViewportFit
        Extent of the target in the image.
    tiles_px : (K, 2) array
        Centres of the tiles that the target may touch, or its outline.
    pixel_m : float
        Width of a pixel at the nearest point of the target [m].
    dense : bool, optional
        True for more samples: the edge pass does not see edges inside textures.
    """
    if np.max(fit.bounds_px[2:] - fit.bounds_px[:2]) <= TINY_PX:
        return TINY_PATTERN
    if quality == "default" and not dense and pixel_m <= NEAR_PIXEL_M:
        return rotated(2)
    for lattice, limit in DENSE_PATTERNS if dense and quality == "default" else PATTERNS[quality]:
        width, height = lattice.window(tiles_px, TILE_REACH_PX)[0]
        if width * height <= limit:
            return lattice
    raise AssertionError("the last lattice of a preset has no limit")
