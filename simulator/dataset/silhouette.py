"""Silhouette of a target at a pose, filled by OpenCV on the CPU, for images that were not drawn here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.check.geometry import subdivide_for_lens
from flyaround.simulator.geometry.triangle_fill import fill_triangles, filled_mask
from flyaround.simulator.labels.boxes import NEAREST_M, projected_bounds
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.labels.truth import Box
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

_GRID_PX = 2048  # longest side of the grid on which the whole silhouette is counted


@dataclass(frozen=True, eq=False)
class Silhouette:
    """The silhouette of a target in the image of a camera.

    Parameters
    ----------
    mask : (H, W) uint8 array
        255 where at least half of the pixel is covered.
    box_amodal_px : Box or None
        Bounds of the whole projected craft; None, with an empty mask, if a part is behind the camera.
    inside : float
        Share of the whole silhouette inside the image.
    """

    mask: ByteArray
    box_amodal_px: Box | None
    inside: float


def silhouette(camera: Camera, pose: Pose, target: Target) -> Silhouette:
    """Return the silhouette of a target; parts outside the lens's field of view are omitted."""
    mesh = joined_mesh(target)
    empty = np.zeros((camera.height_px, camera.width_px), np.uint8)
    in_camera = pose.apply(mesh.positions_m)
    if in_camera[:, 2].min() <= NEAREST_M:
        return Silhouette(empty, None, 0.0)
    x0, y0, x1, y1 = box = projected_bounds(camera, in_camera, mesh.triangles)
    if camera.distortion.is_none:
        corners = camera.project(in_camera)[mesh.triangles]
    else:
        triangles = mesh.positions_m[mesh.triangles]
        subdivided = subdivide_for_lens(camera, triangles, pose.R, np.asarray(pose.t_m))
        corners = camera.project(pose.apply(subdivided.reshape(-1, 3))).reshape(-1, 3, 2)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    size = (camera.width_px, camera.height_px)
    inside = x0 >= -0.5 and y0 >= -0.5 and x1 <= size[0] - 0.5 and y1 <= size[1] - 0.5
    share = 1.0 if inside else _share_inside(corners, size)
    return Silhouette(filled_mask(corners, size), box, share)


def _share_inside(corners_px: FloatArray, size: tuple[int, int]) -> float:
    low, high = corners_px.min(axis=(0, 1)), corners_px.max(axis=(0, 1))
    if np.any(high < -0.5) or np.any(low > np.asarray(size) - 0.5):
        return 0.0
    scale = min(1.0, _GRID_PX / float((high - low).max()))
    shape = tuple(int(n) + 3 for n in np.ceil((high - low) * scale)[::-1])
    grid = np.zeros(shape, np.uint8)
    fill_triangles(grid, (corners_px - low) * scale + 1)
    x, y = ((np.arange(n) - 1) / scale + start for n, start in zip(shape[::-1], low, strict=True))
    in_image = ((x >= -0.5) & (x < size[0] - 0.5))[None, :] & ((y >= -0.5) & (y < size[1] - 0.5))[:, None]
    n_samples = int(np.count_nonzero(grid))
    return int(np.count_nonzero(grid[in_image])) / n_samples if n_samples else 0.0
