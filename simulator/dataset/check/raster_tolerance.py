"""Raster tolerance: the triangles that a rasteriser may draw at a pixel's centre after rounding their vertices.

A rasteriser rounds every vertex by up to 1/512 px along each axis before it tests coverage, and then interpolates depth
and normal on the unrounded plane. Rods, edges and cracks can be narrower than this rounding, so that rays through and
around the centre miss them. Therefore every nearby triangle is tested with the rounding as tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray, IntArray

SNAP_PX = 1 / 128
"""Rounding of a vertex and of the opposite edge together, doubled for the rasteriser's arithmetic [px]."""

MAX_OVERHANG = 4.0
"""Largest overhang of a triangle that is thinner than the rounding, relative to its height."""

HORIZON_COSINE = 0.01
"""Cosine to the line of sight below which a normal may have been clamped to the horizon."""


@dataclass(frozen=True, eq=False)
class CandidateTriangles:
    """Triangles that a rasteriser may draw at one pixel's centre.

    Parameters
    ----------
    nearest_m : (M,) array
        Smallest camera z of each triangle at the pixel's centre [m].
    farthest_m : (M,) array
        Largest camera z of each triangle at the pixel's centre [m].
    parts : (M,) array
        Part numbers, from 1.
    cones : (M, 3, 3) array
        Normals at the corners (rows), camera frame, extrapolated by the rounding: any drawn normal is a positive
        combination of the three.
    is_sure : bool
        True if one of the triangles covers the centre whatever the rounding.
    """

    nearest_m: FloatArray
    farthest_m: FloatArray
    parts: IntArray
    cones: FloatArray
    is_sure: bool

    def has_normal(self, normal: FloatArray, ray: FloatArray, within_rad: float) -> bool:
        """Return True if a normal towards the camera is that of a surface here.

        Parameters
        ----------
        normal : (3,) array
            Unit normal, camera frame.
        ray : (3,) array
            Unit vector from the camera through the pixel.
        within_rad : float
            Maximum angle between the normals [rad].
        """
        clamped = [-ray] if abs(normal @ ray) < HORIZON_COSINE else []
        return any(
            nnls(np.stack([*(side * cone), *clamped], axis=1), normal)[1] < within_rad
            for cone in self.cones
            for side in (1, -1)
        )


def triangles_near(
    corners_px: FloatArray, inverse_z: FloatArray, normals: FloatArray, parts: IntArray, radius_px: float
) -> CandidateTriangles:
    """Return the triangles that may be drawn at the origin of the plane of ``corners_px``.

    Parameters
    ----------
    corners_px : (K, 3, 2) array
        Corners relative to the pixel's centre.
    inverse_z : (K, 3) array
        1 / camera z of the corners [1/m].
    normals : (K, 3, 3) array
        Unit normals, camera frame.
    parts : (K,) array
        Part numbers.
    radius_px : float
        Largest distance of a drawn point from the centre.
    """
    inside, border_px = _inside_by(corners_px)
    close = inside | (border_px <= radius_px)
    corners, inverse, border = corners_px[close], inverse_z[close], border_px[close]
    sure = inside[close] & (border > SNAP_PX)
    area2, longest = _twice_area(corners), _longest_edge(corners)
    height = np.abs(area2) / np.maximum(longest, 1e-12)
    overhang = np.minimum(SNAP_PX / np.maximum(height, 1e-12), MAX_OVERHANG)
    low, high = _inverse_range(corners, inverse, area2, overhang, radius_px)
    nearest, farthest = 1 / np.maximum(high, 1e-9), 1 / np.maximum(low, 1e-9)
    first = farthest[sure].min(initial=np.inf)
    possible = nearest <= first
    n, e = normals[close], overhang[:, None, None]
    cones = n * (1 + 2 * e) - e * (np.roll(n, 1, axis=1) + np.roll(n, 2, axis=1))
    return CandidateTriangles(
        nearest[possible], farthest[possible], parts[close][possible], cones[possible], bool(sure.any())
    )


def _inverse_range(
    corners: FloatArray, inverse: FloatArray, area2: FloatArray, overhang: FloatArray, radius_px: float
) -> tuple[FloatArray, FloatArray]:
    """Return (M,) bounds of 1/z within ``radius_px`` of the origin, extrapolated by no more than the rounding."""
    span = np.ptp(inverse, axis=1) * overhang
    low, high = inverse.min(axis=1) - span, inverse.max(axis=1) + span
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = inverse[:, 1] - inverse[:, 0], inverse[:, 2] - inverse[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        # gradient of the plane; 1/z is linear in the image
        g = np.stack([d1 * e2[:, 1] - d2 * e1[:, 1], d2 * e1[:, 0] - d1 * e2[:, 0]], axis=1) / area2[:, None]
        offset = inverse[:, 0] - (g * corners[:, 0]).sum(axis=1)
        reach = np.hypot(*g.T) * radius_px
        return np.fmax(low, offset - reach), np.fmin(high, offset + reach)


def _inside_by(corners: FloatArray) -> tuple[np.typing.NDArray[np.bool_], FloatArray]:
    """Return (K,) True for triangles (K, 3, 2) that contain the origin, and its distance from their borders [px]."""
    following = np.roll(corners, -1, axis=1)
    edges = following - corners
    side = corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]
    inside = np.all(side >= 0, axis=1) | np.all(side <= 0, axis=1)
    along = -(corners * edges).sum(axis=2) / np.maximum((edges**2).sum(axis=2), 1e-24)
    foot = corners + np.clip(along, 0, 1)[..., None] * edges
    return inside, np.hypot(foot[..., 0], foot[..., 1]).min(axis=1)


def _twice_area(corners: FloatArray) -> FloatArray:
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])


def _longest_edge(corners: FloatArray) -> FloatArray:
    edges = np.roll(corners, -1, axis=1) - corners
    return np.asarray(np.hypot(edges[..., 0], edges[..., 1]).max(axis=1))
