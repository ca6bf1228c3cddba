"""Viewport fit: the pixels and tiles that a target may touch, its depth range, and how densely it is sampled."""

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
# lattices to try in order, and the largest buffer [samples] it may take
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
# Where a pixel is no wider than this on the craft [m], five samples do by default. Seven are for gaps between solar
# cells, 0.8 to 4 mm wide: five show them as dashes where they are a third of a pixel wide, and as they are
# from one pixel on.
NEAR_PIXEL_M = 1e-3
DENSE_PATTERNS = ((rotated(4), 10e6), (rotated(3), 22e6), (rotated(2), np.inf))
TINY_PX = 22  # a target no larger gets the finest lattice: its whole light is in few pixels
TILE_REACH_PX = (TILE_PX - 1) / 2
TINY_PATTERN = rotated(8)  # 65 samples per pixel


@dataclass(frozen=True, eq=False)
class ViewportFit:
    """The target's place in the image: bounds (not clipped), pixels to draw, depth range.

    The pixels to draw begin at whole tiles of the cover, and end there or at the image's edge. ``hull_px``: corners
    (2, K) of the parts' hulls in the image, bent by the lens, where all of them is before the camera; ``hull_parts``:
    where those of the second hull begin, of the third and so on. ``nearest_m``: camera's z of what is nearest of the
    mesh; the depth range is of its sphere. ``longest_m``: of its edges, that a lens does not bend visibly.
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
        """True if some of the target may be nearer than the near plane."""
        return self.near_far_m[0] <= MIN_NEAR_M

    def pixel_m(self, camera: Camera) -> float:
        """Width of a pixel on what is nearest of the mesh [m]."""
        return self.nearest_m / max(camera.fx_px, camera.fy_px)

    @property
    def camera_target_m(self) -> FloatArray:
        """Place of the camera in the target frame [m]."""
        return np.asarray(-self.camera_from_target[:3, :3].T @ self.camera_from_target[:3, 3])


def all_tiles(rect: PixelRect) -> FloatArray:
    """Centres (K, 2) [px] of all the tiles of a rectangle that begins at whole tiles."""
    return tile_centers(np.ones((-(-rect.height // TILE_PX), -(-rect.width // TILE_PX)), bool), rect)


def tile_centers(tiles: BoolArray, rect: PixelRect) -> FloatArray:
    """Centres (K, 2) [px] of some tiles (rows, columns) of a rectangle."""
    row, column = np.nonzero(tiles)
    middle = (TILE_PX - 1) / 2
    centers = np.empty((len(row), 2))
    centers[:, 0] = column * TILE_PX + (rect.x0 + middle)
    centers[:, 1] = row * TILE_PX + (rect.y0 + middle)
    return centers


def matrix_of(R: FloatArray, t_m: ArrayLike) -> FloatArray:
    """(4, 4) of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t_m
    return matrix


def fit_viewport(
    mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, *, clip: bool = True
) -> ViewportFit | None:
    """Fit the viewport to the target; ``None`` when none of it is in front of the camera (and, clipped, on the image).

    A target that reaches behind the camera is given twice the image's size on each side.
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
    """(K, 2) places [px] that span what the target may touch, without looking for its tiles; of all tiles else."""
    if place.hull_px is None:
        return all_tiles(place.rect)
    rect = place.rect
    return np.clip(place.hull_px.T, [rect.x0, rect.y0], [rect.x1 - 1, rect.y1 - 1])


def choose_pattern(
    quality: Quality, place: ViewportFit, tiles_px: FloatArray, pixel_m: float, *, dense: bool = False
) -> SamplePattern:
    """The finest lattice of the preset whose buffer stays within its limit.

    Parameters
    ----------
    tiles_px : (K, 2) centres of the tiles that the target may touch, or its outline.
    pixel_m : width of a pixel on what is nearest of the target [m].
    dense : more samples, where no edges weigh them: inside textures.
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
