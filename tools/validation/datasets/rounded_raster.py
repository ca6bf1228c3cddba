"""Rasterisation of one pixel in integers: the parts that a mesh shows there once its corners are rounded.

A raster rounds corners to 1/256 px and tests which triangles contain the pixel's centre. It may therefore show a face
seen edge-on that is thinner than this step where the ray through the centre misses the face, and no nearby ray need hit
it. Shared corners are rounded to the same place, so a closed surface has no cracks here either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEPS = 256
"""Sub-pixel steps of a raster: those of Mesa's software driver, and the minimum of GPUs."""
ROUNDING_PX = 2 / STEPS
"""Maximum displacement of a plane's depth by the rounding of two corners (docs/datasets.md)."""
_TRIES = 24  # number of roundings that are tried
# single-precision error of a corner halfway between two steps: both roundings are tried
_UNSURE_PX = 2e-4
LENS_PX = 0.02
"""Maximum distance of a distorted edge from the exact lens projection (docs/camera.md)."""


def shown_parts(
    corners_px: NDArray[Any],
    depth_m: NDArray[Any],
    parts: NDArray[Any],
    coplanar_m: float,
    *,
    lens: bool = False,
) -> set[int]:
    """Return the parts that a raster may show at the origin of the image plane; 0 where it may show none.

    Parameters
    ----------
    corners_px : (K, 3, 2) array
        Corners of the triangles relative to the pixel's centre.
    depth_m : (K, 3) array
        Depths of the corners, all positive.
    parts : (K,) array
        Part of each triangle.
    coplanar_m : float
        Maximum distance behind the first surface at which another may be shown.
    lens : bool, optional
        True if the corners are undistorted, while the image follows the distortion by straight segments.
    """
    unsure_px, rounding_px = (LENS_PX, ROUNDING_PX + LENS_PX) if lens else (_UNSURE_PX, ROUNDING_PX)
    near = np.all(corners_px.min(axis=1) <= 1, axis=1) & np.all(corners_px.max(axis=1) >= -1, axis=1)
    corners, depth, part = corners_px[near], depth_m[near], parts[near]
    # equal corners are one corner, rounded once
    places, of_corner = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    rng = np.random.default_rng(0)
    shown: set[int] = set()
    for k in range(_TRIES):
        moved = places + (rng.uniform(-unsure_px, unsure_px, places.shape) if k else 0.0)
        rounded = np.rint(moved * STEPS).astype(np.int64)[of_corner.reshape(-1)].reshape(-1, 3, 2)
        twice_area = _cross(rounded[:, 1] - rounded[:, 0], rounded[:, 2] - rounded[:, 0])
        holds_centre = _holds_origin(rounded, twice_area)
        # back faces, clockwise in an image whose rows go down, are not drawn where a body is closed
        for drawn in (holds_centre, holds_centre & (twice_area < 0)):
            shown |= _first(corners[drawn], depth[drawn], part[drawn], coplanar_m, rounding_px)
    return shown


def _cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _holds_origin(corners: NDArray[np.int64], twice_area: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (K,) True for triangles (K, 3, 2) with integer corners that contain the origin; of two that share an edge
    through the origin, one contains it.
    """
    turned = np.where(twice_area[:, None, None] < 0, corners[:, ::-1], corners)
    edge = np.roll(turned, -1, axis=1) - turned
    side = _cross(edge, -turned)
    x, y = edge[..., 0], edge[..., 1]
    is_own = (y < 0) | ((y == 0) & (x > 0))
    return np.asarray((twice_area != 0) & np.all((side > 0) | ((side == 0) & is_own), axis=1))


def _first(
    corners: NDArray[Any],
    depth_m: NDArray[Any],
    parts: NDArray[Any],
    coplanar_m: float,
    rounding_px: float,
) -> set[int]:
    """Return the parts of the triangles that are nearest at the origin."""
    if not len(parts):
        return {0}
    inverse = 1 / depth_m
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice_area = _cross(e1, e2)
    longest = np.hypot(*np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0)).max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # 1/z is linear on the image: from the first corner to the origin
        b, c = _cross(-corners[:, 0], e2) / twice_area, _cross(e1, -corners[:, 0]) / twice_area
        inverse_depth = (
            inverse[:, 0] + b * (inverse[:, 1] - inverse[:, 0]) + c * (inverse[:, 2] - inverse[:, 0])
        )
        # change of the inverse depth over a pixel
        along = (
            np.stack([inverse[:, 1] - inverse[:, 0], inverse[:, 2] - inverse[:, 0]], axis=1)
            / twice_area[:, None]
        )
        slope = np.hypot(
            along[:, 0] * e2[:, 1] - along[:, 1] * e1[:, 1], along[:, 1] * e1[:, 0] - along[:, 0] * e2[:, 0]
        )
    # a plane is as exact as its corners: its depth may be that of a position this far from the origin, and a thinner
    # triangle limits the depth only to the range of its corners
    thin = np.abs(twice_area) <= rounding_px * longest
    unsure = np.where(thin, np.inf, rounding_px * slope)
    high = np.minimum(np.where(thin, np.inf, inverse_depth) + unsure, inverse.max(axis=1))
    low = np.maximum(np.where(thin, -np.inf, inverse_depth) - unsure, inverse.min(axis=1))
    first = low.max()
    return set(parts[high >= first / (1 + coplanar_m * first)].tolist())
