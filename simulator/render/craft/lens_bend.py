"""Bending of a target's edges and outlines by a lens: the longest straight piece that follows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.projection import PixelRect
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

TOLERANCE_PX = 0.02
"""Largest distance between a straight line and its distorted image, in the middle of its longest piece."""
MOST_TRIANGLES = 250_000
"""Largest number of triangles after cutting; only a large craft around the camera would need more."""
_OUTLINE_PX = 0.1  # the same tolerance for outlines, which only select pixels to draw
_COVERING = 5.0  # triangles per square of their longest edge


def longest_edge_m(mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, rect: PixelRect) -> float:
    """Return the longest edge of a mesh that may be drawn straight; infinite if all may.

    It is the mesh's diameter over a power of the root of two, so that a few cuts serve all views of a craft.
    """
    bending = camera.bending_px_rad2((rect.x0, rect.y0, rect.x1, rect.y1))
    place = -camera_from_target[:3, :3].T @ camera_from_target[:3, 3]
    # distance to the mesh's bounding box
    low, high = mesh.hull_m.min(axis=1), mesh.hull_m.max(axis=1)
    nearest_m = float(np.linalg.norm(np.maximum(np.maximum(low - place, place - high), 0.0)))
    diameter_m = 2 * mesh.radius_m
    if bending * diameter_m**2 <= 8 * TOLERANCE_PX * nearest_m**2:
        return np.inf
    # a piece spans at most the angle of its length over its distance
    asked_m = nearest_m * np.sqrt(8 * TOLERANCE_PX / bending)
    least_m = np.sqrt(_COVERING * mesh.area_m2 / MOST_TRIANGLES)
    return float(diameter_m / 2 ** (np.ceil(2 * np.log2(diameter_m / max(asked_m, least_m))) / 2))


def bent_outlines(camera: Camera, hulls_m: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return points (3, M) along the outlines of convex hulls for a lens, and the start of each hull but the first.

    Straight lines between their images follow the outlines to 0.1 px.

    Parameters
    ----------
    hulls_m : (3, K) array
        Points of all hulls in turn, camera frame, in front of the camera.
    parts : array
        Start of each but the first.
    """
    flat = np.ascontiguousarray((hulls_m[:2] / hulls_m[2]).T, np.float32)
    starts = [0, *parts.tolist()]
    corners = [
        first + cv2.convexHull(one, returnPoints=False).ravel()
        for first, one in zip(starts, np.split(flat, parts), strict=True)
    ]
    ways = hulls_m / np.linalg.norm(hulls_m, axis=0)
    start = ways[:, np.concatenate(corners)]
    end = ways[:, np.concatenate([np.roll(some, -1) for some in corners])]
    half_sine = np.minimum(0.5 * np.linalg.norm(start - end, axis=0), 0.99)
    angle = 2 * half_sine / np.sqrt(1 - half_sine**2)
    count = np.ceil(angle * np.sqrt(camera.bending_px_rad2() / (8 * _OUTLINE_PX))).astype(np.int64) + 1
    ends = np.cumsum(count)
    share = (np.arange(ends[-1]) - np.repeat(ends - count, count)) / np.repeat(count, count)
    points = np.repeat(start, count, axis=1) * (1 - share) + np.repeat(end, count, axis=1) * share
    return points, ends[np.cumsum([len(some) for some in corners])[:-1] - 1]
