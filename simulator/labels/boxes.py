"""Bounding boxes of the craft in the image: of the visible mask, and of the whole projected craft (amodal)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.labels.truth import Box
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray, IntArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

NEAREST_M = 1e-3  # points closer to the camera's plane, or behind it, have no projection
BOW_PX = 1e-7  # largest excess of a bowed edge over the amodal box
SHORT_PX = (
    32.0  # length below which the bow at the middle is trusted: a longer edge may change its bend there
)
MAX_BISECTIONS = 60  # each divides the bow by about four; the limit only guards against rounding


def craft_window(mask: ByteArray) -> tuple[slice, slice]:
    """Return rows and columns that contain a mask, so that the rest of the image need not be processed.

    Returns
    -------
    rows : slice
        First and end row that contain the mask; 0 to 0 if it is empty.
    columns : slice
        First and end column, likewise.
    """
    rows = np.flatnonzero(mask.any(axis=1))
    if not rows.size:
        return slice(0, 0), slice(0, 0)
    columns = np.flatnonzero(mask[rows[0] : rows[-1] + 1].any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def mask_box(mask: ByteArray) -> Box | None:
    """Return the bounding box of a mask at pixel edges.

    Returns
    -------
    tuple of float or None
        x0, y0, x1, y1 [px]: a one-pixel mask at (3, 4) gives 2.5, 3.5, 3.5, 4.5. None for an empty mask.
    """
    rows, columns = craft_window(mask)
    if rows.stop == 0:
        return None
    return (columns.start - 0.5, rows.start - 0.5, columns.stop - 0.5, rows.stop - 0.5)


def amodal_box(scene: SceneState, target: Target) -> Box | None:
    """Return the bounds of the whole projected craft, not clipped to the image.

    Returns
    -------
    tuple of float or None
        x0, y0, x1, y1 [px]; None if a vertex is behind the camera or within `NEAREST_M` of its plane.
    """
    mesh = joined_mesh(target)
    # without lens distortion, the extremes of a projection are corners of the convex hull
    points = mesh.hull_m if scene.camera.distortion.is_none else mesh.positions_m
    in_camera = scene.camera_from_target.apply(points)
    if in_camera[:, 2].min() <= NEAREST_M:
        return None
    return projected_bounds(scene.camera, in_camera, mesh.triangles)


def projected_bounds(camera: Camera, in_camera_m: FloatArray, triangles: IntArray) -> Box:
    """Return the bounds of a projected mesh, to `BOW_PX` under a lens, which bows straight edges.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    in_camera_m : (N, 3) array
        Vertices in front of the camera, camera frame [m].
    triangles : (M, 3) array
        Vertex indices; not used without distortion.

    Returns
    -------
    tuple of float
        x0, y0, x1, y1 [px].
    """
    pixels = np.ascontiguousarray(camera.project(in_camera_m).T)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    if not camera.distortion.is_none:
        corners = pixels[:, triangles.T]
        half_size = np.ptp(corners, axis=1).sum(axis=0) / 2  # at least half of the longest edge
        near = triangles[_may_exceed(low, high, corners, half_size)]
        edges = np.concatenate([near[:, [0, 1]], near[:, [1, 2]], near[:, [2, 0]]])
        low, high = _bounds_with_bows(camera, in_camera_m[edges], low, high)
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    return (x0, y0, x1, y1)


def _bounds_with_bows(
    camera: Camera, ends_m: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Enlarge bounds ``low``, ``high`` (2,) of the ends (E, 2, 3) of straight edges to those of all their points.

    Pieces of edges that may exceed the bounds are bisected. A straight line turns by less than half a turn in the
    image, so a piece reaches beyond its ends by at most half its chord. A short piece that bends or kinks once does so
    by at most twice the distance between its middle and that of its chord.
    """
    ends_px = camera.project(ends_m).T
    reach = _length(ends_px[:, 1] - ends_px[:, 0]) / 2
    for _ in range(MAX_BISECTIONS):
        is_near = _may_exceed(low, high, ends_px, reach)
        if not is_near.any():
            break
        (start_m, end_m), (start_px, end_px) = (
            ends_m[is_near].swapaxes(0, 1),
            ends_px[..., is_near].swapaxes(0, 1),
        )
        middle_m = (start_m + end_m) / 2
        middle_px = camera.project(middle_m).T
        low, high = np.minimum(low, middle_px.min(axis=1)), np.maximum(high, middle_px.max(axis=1))
        ends_m = np.stack([np.concatenate([start_m, middle_m]), np.concatenate([middle_m, end_m])], axis=1)
        ends_px = np.stack([np.hstack([start_px, middle_px]), np.hstack([middle_px, end_px])], axis=1)
        chord = _length(ends_px[:, 1] - ends_px[:, 0])
        bow = np.tile(_length(middle_px - (start_px + end_px) / 2), 2)
        reach = np.where(chord > SHORT_PX, chord / 2, 2 * bow)
    return low, high


def _length(xy: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(xy[0], xy[1]))


def _may_exceed(low: FloatArray, high: FloatArray, points_px: FloatArray, reach: FloatArray) -> BoolArray:
    """Return (E,) True where points (2, K, E), enlarged by ``reach`` (E,), exceed bounds by more than `BOW_PX`."""
    reach = reach - BOW_PX
    exceeds = (points_px.min(axis=1) - reach < low[:, None]) | (points_px.max(axis=1) + reach > high[:, None])
    return np.asarray(exceeds[0] | exceeds[1])
