"""Bending of a target's edges and outlines by a lens: the length up to which a straight line follows a bent one."""

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
"""Between a straight line and what the lens makes of it, in the middle of its longest piece."""
MOST_TRIANGLES = 250_000
"""Of a cut mesh; what would need more, a large craft so near that it surrounds the camera, bends a little less well."""
_OUTLINE_PX = 0.1  # as `TOLERANCE_PX`, of outlines that choose pixels to draw
_COVERING = 5.0  # triangles per square of their longest edge


def longest_edge_m(mesh: GpuMesh, camera_from_target: FloatArray, camera: Camera, rect: PixelRect) -> float:
    """Longest edge of a mesh that may be drawn straight, infinite where all may.

    It is the mesh's diameter over a power of the root of two, so that a craft has a few cuts that serve all its views.
    """
    bending = camera.bending_px_rad2((rect.x0, rect.y0, rect.x1, rect.y1))
    place = -camera_from_target[:3, :3].T @ camera_from_target[:3, 3]
    # from there to the box that holds the mesh
    low, high = mesh.hull_m.min(axis=1), mesh.hull_m.max(axis=1)
    nearest_m = float(np.linalg.norm(np.maximum(np.maximum(low - place, place - high), 0.0)))
    diameter_m = 2 * mesh.radius_m
    if bending * diameter_m**2 <= 8 * TOLERANCE_PX * nearest_m**2:
        return np.inf
    # a piece is seen under an angle of its length over its distance, at most
    asked_m = nearest_m * np.sqrt(8 * TOLERANCE_PX / bending)
    least_m = np.sqrt(_COVERING * mesh.area_m2 / MOST_TRIANGLES)
    return float(diameter_m / 2 ** (np.ceil(2 * np.log2(diameter_m / max(asked_m, least_m))) / 2))


def bent_outlines(camera: Camera, hulls_m: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Points (3, M) along the outlines of convex hulls that a lens bends, and where those of the second begin.

    Straight lines between their pictures follow the outlines' to a tenth of a pixel.

    Parameters
    ----------
    hulls_m : (3, K) of all hulls, one after the other, camera frame, before the camera. parts : where they begin.
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
