"""Bounding boxes of the craft in the image: of the visible mask, and of the whole projected craft (amodal)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.labels.truth import Box
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

NEAREST_M = 1e-3  # points closer to the camera's plane, or behind it, have no projection


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
    """Return the bounds of all projected vertices, not clipped to the image.

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
    pixels = scene.camera.project(in_camera)
    x0, y0 = pixels.min(axis=0)
    x1, y1 = pixels.max(axis=0)
    return (float(x0), float(y0), float(x1), float(y1))
