"""Projected triangles filled by OpenCV on the CPU."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

FILL_SCALE = 4  # subpixels along each side of a pixel
FILL_SHIFT = 4  # fractional bits of OpenCV's coordinates
# Distance beyond the image at which polygons are clipped [px], because OpenCV accumulates rounding errors row by row.
CLIP_MARGIN_PX = 4096


def filled_mask(corners_px: FloatArray, size: tuple[int, int]) -> ByteArray:
    """Fill triangles (M, 3, 2) in a mask of a width and height.

    Returns
    -------
    (height, width) array
        uint8 mask: 255 where the triangles cover at least half of a pixel, else 0.
    """
    mask = np.zeros(size[::-1], np.uint8)
    low = np.clip(np.floor(corners_px.min(axis=(0, 1))) - 1, 0, size).astype(int)
    high = np.clip(np.ceil(corners_px.max(axis=(0, 1))) + 2, 0, size).astype(int)
    if np.any(high <= low):
        return mask
    width, height = (high - low).tolist()
    fine = np.zeros((height * FILL_SCALE, width * FILL_SCALE), np.uint8)
    # a pixel's centre is at (FILL_SCALE - 1) / 2 on the finer grid; OpenCV also fills pixels that the border touches,
    # half of which is too much
    fill_triangles(fine, (corners_px - low) * FILL_SCALE + (FILL_SCALE - 1) / 2)
    inner = cv2.erode(fine, np.ones((3, 3), np.uint8))
    share = cv2.resize(
        cv2.addWeighted(fine, 0.5, inner, 0.5, 0), (width, height), interpolation=cv2.INTER_AREA
    )
    mask[low[1] : high[1], low[0] : high[0]] = np.where(share >= 128, np.uint8(255), np.uint8(0))
    return mask


def lowest_and_highest(corners: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the bounds of triangles (M, 3, 2), because NumPy is slow along short axes.

    Returns
    -------
    low : (M, 2) array
        Least coordinates of each triangle.
    high : (M, 2) array
        Greatest coordinates.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def fill_triangles(fine: ByteArray, corners: FloatArray) -> None:
    """Fill triangles (M, 3, 2). Triangles within a single pixel, as in a distant craft, are set in one NumPy step."""
    cells = np.rint(corners).astype(np.int64)
    lowest, highest = lowest_and_highest(cells)
    in_one_pixel = (lowest[:, 0] == highest[:, 0]) & (lowest[:, 1] == highest[:, 1])
    x, y = cells[in_one_pixel, 0].T
    in_image = (x >= 0) & (y >= 0) & (x < fine.shape[1]) & (y < fine.shape[0])
    fine[y[in_image], x[in_image]] = 255
    large = corners[~in_one_pixel]
    low, high = lowest_and_highest(large)
    limit = fine.shape[::-1] + np.array([CLIP_MARGIN_PX, CLIP_MARGIN_PX])
    inside = np.all(high >= -1, axis=1) & np.all(low <= fine.shape[::-1], axis=1)
    far = inside & (np.any(low < -CLIP_MARGIN_PX, axis=1) | np.any(high > limit, axis=1))
    near = [*np.rint(large[inside & ~far] * 2**FILL_SHIFT).astype(np.int32)]
    clipped = [polygon_within(triangle, -CLIP_MARGIN_PX, limit) for triangle in large[far]]
    for polygon in near + [np.rint(p * 2**FILL_SHIFT).astype(np.int32) for p in clipped if len(p)]:
        cv2.fillConvexPoly(fine, polygon, 255, cv2.LINE_8, FILL_SHIFT)


def polygon_within(polygon: FloatArray, low: float, high: FloatArray) -> FloatArray:
    """Clip a convex polygon (K, 2) to the box ``low`` to ``high`` (2,); return corners (L, 2), none if it lies outside.

    Source: Sutherland and Hodgman (1974), Reentrant polygon clipping.
    """
    for axis, sign, bound in ((0, 1, low), (1, 1, low), (0, -1, -high[0]), (1, -1, -high[1])):
        if not len(polygon):
            break
        inside = sign * polygon[:, axis] - bound
        corners = []
        for k, distance in enumerate(inside):
            previous = inside[k - 1]
            if (distance >= 0) != (previous >= 0):
                corners.append(
                    polygon[k - 1] + previous / (previous - distance) * (polygon[k] - polygon[k - 1])
                )
            if distance >= 0:
                corners.append(polygon[k])
        polygon = np.array(corners).reshape(-1, 2)
    return polygon
