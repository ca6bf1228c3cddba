"""One pixel of a raster, done again in whole numbers: what a mesh shows there once its corners are rounded.

A raster rounds corners to 1/256 px and asks which triangles hold the pixel's centre. A face that is seen edge-on, and
is thinner than that, may so be shown where a ray through the centre just misses it, and no ray near it need hit it.
Corners that are shared are rounded alike, so that a closed sheet has no cracks here either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEPS = 256
"""Sub-pixel steps of a raster: Mesa's software driver, and the least of GPUs."""
ROUNDING_PX = 2 / STEPS
"""Largest displacement of a plane's depth by the rounding of two corners (docs/datasets.md)."""
_TRIES = 24
# error of a corner between two steps in single precision; tries go either way
_UNSURE_PX = 2e-4
LENS_PX = 0.02
"""Largest distance of a curved edge from the exact lens projection (docs/camera.md)."""


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
        Of triangles, from the pixel's centre.
    depth_m : (K, 3) array
        Of the corners, all positive.
    parts : (K,) array
        .
    coplanar_m : float
        How far behind the first another may lie and be shown.
    lens : bool, optional
        True if the corners are where they were without the lens, which the image follows by straight pieces.
    """
    unsure_px, rounding_px = (LENS_PX, ROUNDING_PX + LENS_PX) if lens else (_UNSURE_PX, ROUNDING_PX)
    near = np.all(corners_px.min(axis=1) <= 1, axis=1) & np.all(corners_px.max(axis=1) >= -1, axis=1)
    corners, depth, part = corners_px[near], depth_m[near], parts[near]
    # equal corners are one: rounded once, to one place
    places, of_corner = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    rng = np.random.default_rng(0)
    shown: set[int] = set()
    for k in range(_TRIES):
        moved = places + (rng.uniform(-unsure_px, unsure_px, places.shape) if k else 0.0)
        whole = np.rint(moved * STEPS).astype(np.int64)[of_corner.reshape(-1)].reshape(-1, 3, 2)
        twice = _cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0])
        held = _holds_origin(whole, twice)
        # faces that look away, by the clock on an image whose rows go down, are not drawn where a body is closed
        for drawn in (held, held & (twice < 0)):
            shown |= _first(corners[drawn], depth[drawn], part[drawn], coplanar_m, rounding_px)
    return shown


def _cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _holds_origin(corners: NDArray[np.int64], twice_area: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the mask of triangles (K, 3, 2) with integer corners that contain the origin; of a shared edge one of
    both does.
    """
    turned = np.where(twice_area[:, None, None] < 0, corners[:, ::-1], corners)
    edge = np.roll(turned, -1, axis=1) - turned
    side = _cross(edge, -turned)
    x, y = edge[..., 0], edge[..., 1]
    mine = (y < 0) | ((y == 0) & (x > 0))
    return np.asarray((twice_area != 0) & np.all((side > 0) | ((side == 0) & mine), axis=1))


def _first(
    corners: NDArray[Any],
    depth_m: NDArray[Any],
    parts: NDArray[Any],
    coplanar_m: float,
    rounding_px: float,
) -> set[int]:
    """Return the parts of those triangles that are nearest at the origin."""
    if not len(parts):
        return {0}
    inverse = 1 / depth_m
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = _cross(e1, e2)
    longest = np.hypot(*np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0)).max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # 1/z is linear on the image: from the first corner to the origin
        b, c = _cross(-corners[:, 0], e2) / twice, _cross(e1, -corners[:, 0]) / twice
        here = inverse[:, 0] + b * (inverse[:, 1] - inverse[:, 0]) + c * (inverse[:, 2] - inverse[:, 0])
        # and what it changes by over a pixel
        along = (
            np.stack([inverse[:, 1] - inverse[:, 0], inverse[:, 2] - inverse[:, 0]], axis=1) / twice[:, None]
        )
        slope = np.hypot(
            along[:, 0] * e2[:, 1] - along[:, 1] * e1[:, 1], along[:, 1] * e1[:, 0] - along[:, 0] * e2[:, 0]
        )
    # a plane is as exact as its corners: the depth may be that of a place this far from the origin, and a thinner
    # triangle constrains it only to the range of its corners
    thin = np.abs(twice) <= rounding_px * longest
    unsure = np.where(thin, np.inf, rounding_px * slope)
    high = np.minimum(np.where(thin, np.inf, here) + unsure, inverse.max(axis=1))
    low = np.maximum(np.where(thin, -np.inf, here) - unsure, inverse.min(axis=1))
    first = low.max()
    return set(parts[high >= first / (1 + coplanar_m * first)].tolist())
