"""Straight pieces that approximate the target's edges and outlines in the image of a distorting lens."""

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
"""Largest distance between an edge's straight piece and the edge's distorted image."""
MAX_TRIANGLES = 250_000
"""Limit on the triangles after cutting. Only a large craft around the camera would need more."""
_OUTLINE_PX = 0.1  # the same tolerance for outlines, which only select the pixels to draw
_MAX_HALF_SINE = 0.99  # of the angle between two corners of an outline: near 1 the tangent diverges
_TRIANGLES_PER_SQUARE = 5.0  # triangles of a cut mesh per square of the longest edge


def longest_edge_m(mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, rect: PixelRect) -> float:
    """Return the length up to which edges of a mesh may be drawn straight [m]; infinite if all may.

    It is the mesh's diameter divided by a power of sqrt(2), so that a few cut meshes serve all views of a craft.

    Parameters
    ----------
    mesh : GpuMesh
        Mesh of the target.
    camera_from_target : (4, 4) array
        Homogeneous transform from the target to the camera frame.
    camera : Camera
        Camera with the lens.
    rect : PixelRect
        Pixels of the target.
    """
    bending = camera.bending_px_rad2((rect.x0, rect.y0, rect.x1, rect.y1))
    camera_m = -camera_from_target[:3, :3].T @ camera_from_target[:3, 3]
    # distance to the mesh's bounding box
    lowest, highest = mesh.hull_m.min(axis=1), mesh.hull_m.max(axis=1)
    nearest_m = float(np.linalg.norm(np.maximum(np.maximum(lowest - camera_m, camera_m - highest), 0.0)))
    diameter_m = 2 * mesh.radius_m
    # the sag of a chord of length d in a curve of curvature c is c d^2 / 8
    if bending * diameter_m**2 <= 8 * TOLERANCE_PX * nearest_m**2:
        return np.inf
    # a piece spans at most the angle of its length over its distance
    tolerated_m = nearest_m * np.sqrt(8 * TOLERANCE_PX / bending)
    least_m = np.sqrt(_TRIANGLES_PER_SQUARE * mesh.area_m2 / MAX_TRIANGLES)
    return float(diameter_m / 2 ** (np.ceil(2 * np.log2(diameter_m / max(tolerated_m, least_m))) / 2))


def bent_outlines(camera: Camera, hulls_m: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return points (3, M) along the outlines of convex hulls, and the start of each hull but the first.

    In the distorted image, straight lines between successive points follow the outlines to 0.1 px.

    Parameters
    ----------
    camera : Camera
        Camera with the lens.
    hulls_m : (3, K) array
        Points of all hulls in turn, camera frame, in front of the camera [m].
    parts : array
        Index of the first point of each hull but the first.
    """
    flat = np.ascontiguousarray((hulls_m[:2] / hulls_m[2]).T, np.float32)
    starts = [0, *parts.tolist()]
    corners = [
        first + cv2.convexHull(hull, returnPoints=False).ravel()
        for first, hull in zip(starts, np.split(flat, parts), strict=True)
    ]
    rays = hulls_m / np.linalg.norm(hulls_m, axis=0)
    start = rays[:, np.concatenate(corners)]
    end = rays[:, np.concatenate([np.roll(outline, -1) for outline in corners])]
    half_sine = np.minimum(0.5 * np.linalg.norm(start - end, axis=0), _MAX_HALF_SINE)
    angle = 2 * half_sine / np.sqrt(1 - half_sine**2)
    count = np.ceil(angle * np.sqrt(camera.bending_px_rad2() / (8 * _OUTLINE_PX))).astype(np.int64) + 1
    ends = np.cumsum(count)
    share = (np.arange(ends[-1]) - np.repeat(ends - count, count)) / np.repeat(count, count)
    points = np.repeat(start, count, axis=1) * (1 - share) + np.repeat(end, count, axis=1) * share
    return points, ends[np.cumsum([len(outline) for outline in corners])[:-1] - 1]
