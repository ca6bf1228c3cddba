"""The silhouette of a target at a pose, its triangles filled by OpenCV on the CPU: for pictures drawn elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.dataset.check.geometry import FILL_SCALE, cut_for_the_lens, fill_triangles
from simulator.labels.boxes import NEAREST_M
from simulator.targets.joined_mesh import mesh_of

if TYPE_CHECKING:
    from simulator.camera.lens.camera_model import Camera
    from simulator.labels.truth import Box
    from simulator.runtime.arrays import ByteArray, FloatArray
    from simulator.targets.model import Target
    from simulator.world.frames.pose import Pose

_SHARE_PX = 2048  # longest side of the grid on which the whole silhouette is counted


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A target's outline in a camera.

    Parameters
    ----------
    mask : (H, W) uint8, 255 where at least half of the pixel is covered.
    box_amodal_px : bounds of all projected vertices; None, and the mask is empty, where a part is behind the camera.
    inside : share of the whole silhouette that falls on the image.
    """

    mask: ByteArray
    box_amodal_px: Box | None
    inside: float


def silhouette(camera: Camera, pose: Pose, target: Target) -> Silhouette:
    """The silhouette of a target; what of it the lens does not see is left out."""
    mesh = mesh_of(target)
    empty = np.zeros((camera.height_px, camera.width_px), np.uint8)
    in_camera = pose.apply(mesh.positions_m)
    if in_camera[:, 2].min() <= NEAREST_M:
        return Silhouette(empty, None, 0.0)
    vertices = camera.project(in_camera)
    (x0, y0), (x1, y1) = np.nanmin(vertices, axis=0).tolist(), np.nanmax(vertices, axis=0).tolist()
    corners = vertices[mesh.triangles]
    if not camera.distortion.is_none:
        whole = mesh.positions_m[mesh.triangles]
        cut = cut_for_the_lens(camera, whole, pose.R, np.asarray(pose.t_m))
        corners = camera.project(pose.apply(cut.reshape(-1, 3))).reshape(-1, 3, 2)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    size = (camera.width_px, camera.height_px)
    inside = x0 >= -0.5 and y0 >= -0.5 and x1 <= size[0] - 0.5 and y1 <= size[1] - 0.5
    share = 1.0 if inside else _share_inside(corners, size)
    return Silhouette(_filled(corners, size), (x0, y0, x1, y1), share)


def pixels_beside(camera: Camera, pose: Pose, target: Target) -> tuple[int, FloatArray] | None:
    """Find the silhouette's pixels beside the image of a pinhole, as far from it as its own size.

    Returns
    -------
    Their number and the (2, 2) x, y of the first and last column and row, NaN of none; None near the camera.
    """
    mesh = mesh_of(target)
    in_camera = pose.apply(mesh.positions_m)
    if in_camera[:, 2].min() <= NEAREST_M:
        return None
    size = np.array([camera.width_px, camera.height_px])
    vertices = camera.project(in_camera) + size + 0.5  # from the corner of a canvas of three images by three
    across = np.diff(np.clip([vertices.min(axis=0), vertices.max(axis=0)], 0, 3 * size), axis=0)
    scale = min(1.0, _SHARE_PX / max(float(np.sqrt(across.prod())), 1.0))
    width, height = np.ceil(3 * size * scale).astype(int).tolist()
    grid = _filled(vertices[mesh.triangles] * scale - 0.5, (width, height))
    grid[tuple(slice(*np.rint(np.array([n, 2 * n]) * scale).astype(int)) for n in size[::-1])] = 0
    x, y, width, height = cv2.boundingRect(grid)
    bounds = np.array([[x, y], [x + width - 1, y + height - 1]]) / scale - size
    count = round(int(np.count_nonzero(grid)) / scale**2)
    return count, bounds if count else np.full((2, 2), np.nan)


def _filled(corners_px: FloatArray, size: tuple[int, int]) -> ByteArray:
    mask = np.zeros(size[::-1], np.uint8)
    low = np.clip(np.floor(corners_px.min(axis=(0, 1))) - 1, 0, size).astype(int)
    high = np.clip(np.ceil(corners_px.max(axis=(0, 1))) + 2, 0, size).astype(int)
    if np.any(high <= low):
        return mask
    width, height = (high - low).tolist()
    fine = np.zeros((height * FILL_SCALE, width * FILL_SCALE), np.uint8)
    # a pixel's centre is at (FILL_SCALE - 1) / 2 on the finer grid; OpenCV fills what a border touches, half of which
    # is too much
    fill_triangles(fine, (corners_px - low) * FILL_SCALE + (FILL_SCALE - 1) / 2)
    inner = cv2.erode(fine, np.ones((3, 3), np.uint8))
    share = cv2.resize(
        cv2.addWeighted(fine, 0.5, inner, 0.5, 0), (width, height), interpolation=cv2.INTER_AREA
    )
    mask[low[1] : high[1], low[0] : high[0]] = np.where(share >= 128, np.uint8(255), np.uint8(0))
    return mask


def _share_inside(corners_px: FloatArray, size: tuple[int, int]) -> float:
    low, high = corners_px.min(axis=(0, 1)), corners_px.max(axis=(0, 1))
    if np.any(high < -0.5) or np.any(low > np.asarray(size) - 0.5):
        return 0.0
    scale = min(1.0, _SHARE_PX / float((high - low).max()))
    shape = tuple(int(n) + 3 for n in np.ceil((high - low) * scale)[::-1])
    grid = np.zeros(shape, np.uint8)
    fill_triangles(grid, (corners_px - low) * scale + 1)
    x, y = ((np.arange(n) - 1) / scale + start for n, start in zip(shape[::-1], low, strict=True))
    on = ((x >= -0.5) & (x < size[0] - 0.5))[None, :] & ((y >= -0.5) & (y < size[1] - 0.5))[:, None]
    whole = int(np.count_nonzero(grid))
    return int(np.count_nonzero(grid[on])) / whole if whole else 0.0
