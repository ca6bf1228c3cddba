"""Rays through sampled pixels against the mesh, in double precision, with a rasteriser's rounding as tolerance.

It shares no code with the engine that makes the labels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from flyaround.simulator.dataset.check.geometry import rays_with_opencv
from flyaround.simulator.dataset.check.mask_statistics import nonzero_pixels
from flyaround.simulator.dataset.check.raster_tolerance import triangles_near
from flyaround.simulator.dataset.check.row_poses import pose_of_row
from flyaround.simulator.geometry.triangle_fill import lowest_and_highest
from flyaround.simulator.imaging.rolling_shutter import BAND_PX
from flyaround.simulator.runtime.memory import cached_per_object
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from flyaround.simulator.dataset.check.raster_tolerance import CandidateTriangles
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray, IntArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

Layers = Mapping[str, NDArray[Any]]

N_SAMPLES = 32  # rays per frame; more find rarer faults, and take proportionally longer
N_ROLLING = 12  # samples; each needs the mesh projected at the pose of its row
# A rasteriser rounds vertices to 1/256 px.
_RING = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], axis=1)

# Offsets of the rays around a pixel's centre, for a radius of 1.
OFFSETS_PX = np.concatenate([[[0.0, 0.0]], 0.25 * _RING, 0.6 * _RING, _RING])

# Tolerance of an edge's position [px], by camera and shutter.
TOLERANCE_PX = 0.03
TOLERANCE_LENS_PX = 0.06  # a bent edge is drawn in straight pieces
TOLERANCE_ROLLING_PX = 0.03 + BAND_PX / 2  # bands are drawn at the time of their middle row

# Tolerance of a depth: relative, and absolute [m].
DEPTH_RELATIVE, DEPTH_M = 2e-5, 1e-4

# Depth difference within which surfaces count as coplanar [m], so that either may be drawn.
COPLANAR_M = 1e-3

# Depth of the near plane at which triangles are clipped [m].
NEAR_M = 1e-3
EDGE_ON_AREA = 1e-14  # twice the area of an edge-on triangle, in the plane z = 1


@dataclass(frozen=True, eq=False)
class Hits:
    """All hits along one ray, nearest first: camera z [m], part (from 1), unit normals (N, 3), camera frame."""

    z_m: FloatArray
    parts: IntArray
    normals: FloatArray


@cached_per_object
def _part_of_triangle(target: Target) -> IntArray:
    return np.repeat(np.arange(1, len(target.parts) + 1), [len(part.triangles) for part in target.parts])


@cached_per_object
def _normals(target: Target) -> FloatArray:
    return np.concatenate([part.normals for part in target.parts]).astype(float)


class RayOracle:
    """A target at a pose, prepared for many rays."""

    def __init__(self, target: Target, camera_from_target: Pose) -> None:
        mesh = joined_mesh(target)
        vertices = camera_from_target.apply(mesh.positions_m)
        triangles, self._parts = mesh.triangles, _part_of_triangle(target)
        self._normals, self._R = _normals(target), camera_from_target.R
        n_ahead = (vertices[triangles, 2] > NEAR_M).sum(axis=1)
        self._triangles, parts = triangles[n_ahead == 3], self._parts[n_ahead == 3]
        crossing = np.flatnonzero((n_ahead > 0) & (n_ahead < 3))
        if len(crossing):
            pieces = [_clip_to_near_plane(vertices, self._normals, triangles[k]) for k in crossing]
            sizes = np.array([len(points) for points, _ in pieces])
            first = len(vertices) + np.concatenate([[0], np.cumsum(sizes)[:-1]])
            # each gives a triangle or a quadrilateral, as a fan from its first corner
            fans = [(i, i + k, i + k + 1) for i, m in zip(first, sizes, strict=True) for k in range(1, m - 1)]
            vertices = np.concatenate([vertices, *(points for points, _ in pieces)])
            self._normals = np.concatenate([self._normals, *(normals for _, normals in pieces)])
            self._triangles = np.concatenate([self._triangles, np.array(fans)])
            parts = np.concatenate([parts, np.repeat(self._parts[crossing], sizes - 2)])
        self._parts = parts
        corners = vertices[self._triangles]
        self._xy = corners[..., :2] / corners[..., 2:]
        self._inverse = 1 / corners[..., 2]
        low, high = lowest_and_highest(self._xy)
        self._low, self._high = np.ascontiguousarray(low.T), np.ascontiguousarray(high.T)

    def largest_triangles(self) -> FloatArray:
        """Return (K, 2) x/z, y/z of the centres of the three triangles of each part with the largest images."""
        e1, e2 = self._xy[:, 1] - self._xy[:, 0], self._xy[:, 2] - self._xy[:, 0]
        order = np.lexsort((-np.abs(_cross(e1, e2)), self._parts))
        _, first, count = np.unique(self._parts[order], return_index=True, return_counts=True)
        rank = np.arange(len(order)) - np.repeat(first, count)
        return np.asarray(self._xy[order[rank < 3]].mean(axis=1))

    def triangles_near(self, ray: FloatArray, px_per_ray: FloatArray, radius_px: float) -> CandidateTriangles:
        """Return the triangles that a rasteriser may draw at the pixel of the ray through (x, y, 1), camera frame.

        Parameters
        ----------
        ray : (3,) array
            Direction (x, y, 1) of the ray, camera frame.
        px_per_ray : (2, 2) array
            Derivative of the pixel by the ray.
        radius_px : float
            Largest distance from the pixel's centre.
        """
        reach = radius_px * np.abs(np.linalg.inv(px_per_ray)).sum(axis=1)
        low, high = self._low, self._high
        near = np.flatnonzero(
            (low[0] <= ray[0] + reach[0])
            & (high[0] >= ray[0] - reach[0])
            & (low[1] <= ray[1] + reach[1])
            & (high[1] >= ray[1] - reach[1])
        )
        return triangles_near(
            (self._xy[near] - ray[:2]) @ px_per_ray.T,
            self._inverse[near],
            self._normals[self._triangles[near]] @ self._R.T,
            self._parts[near],
            radius_px,
        )

    def hits(self, ray: FloatArray) -> Hits:
        """Return the hits along the ray through (x, y, 1), camera frame."""
        low, high = self._low, self._high
        near = np.flatnonzero(
            (low[0] <= ray[0]) & (high[0] >= ray[0]) & (low[1] <= ray[1]) & (high[1] >= ray[1])
        )
        a, b, c = (self._xy[near, k] - ray[:2] for k in range(3))
        weights = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
        area = weights.sum(axis=1)
        inside = (np.abs(area) > EDGE_ON_AREA) & (np.all(weights >= 0, axis=1) | np.all(weights <= 0, axis=1))
        near, weights = near[inside], weights[inside] / area[inside, None]
        # barycentric coordinates in the image; divided by depth, those on the triangle
        inverse = (weights * self._inverse[near]).sum(axis=1)
        on_triangle = weights * self._inverse[near] / inverse[:, None]
        normals = (on_triangle[..., None] * self._normals[self._triangles[near]]).sum(axis=1) @ self._R.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        order = np.argsort(-inverse)
        return Hits(1 / inverse[order], self._parts[near][order], normals[order])


def _clip_to_near_plane(
    vertices: FloatArray, normals: FloatArray, triangle: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Clip a triangle to the half-space in front of the camera; return its corners (3 or 4, 3) in order and their
    normals.
    """
    points, corner_normals = [], []
    for a, b in zip(triangle, np.roll(triangle, -1), strict=True):
        za, zb = vertices[a, 2], vertices[b, 2]
        if za > NEAR_M:
            points.append(vertices[a])
            corner_normals.append(normals[a])
        if (za > NEAR_M) != (zb > NEAR_M):
            fraction = (NEAR_M - za) / (zb - za)
            points.append(vertices[a] + fraction * (vertices[b] - vertices[a]))
            corner_normals.append(normals[a] + fraction * (normals[b] - normals[a]))
    return np.array(points), np.array(corner_normals)


@lru_cache(maxsize=2)
def ray_oracle(target: Target, camera_from_target: Pose) -> RayOracle:
    """Return a target at a pose, cached for further checks of the same frame."""
    return RayOracle(target, camera_from_target)


def _cross(p: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


@dataclass(frozen=True, eq=False)
class SampledRays:
    """First surfaces hit by rays around one pixel's centre: depths, parts and normals (N, 3).

    ``misses`` is True if one of the rays hits nothing. ``candidates`` holds the triangles that a rasteriser may draw
    there after rounding, if requested.
    """

    z_m: FloatArray
    parts: frozenset[int]
    normals: FloatArray
    misses: bool
    candidates: CandidateTriangles | None = None

    @staticmethod
    def from_hits(hits_by_ray: list[Hits]) -> SampledRays:
        """Merge the first surfaces of several rays; at an outline, all surfaces.

        There, rounding may omit the first surface and show the edge of the next one.
        """
        with_hits = [h for h in hits_by_ray if len(h.z_m)]
        misses = len(with_hits) < len(hits_by_ray)
        hits = with_hits if misses else [_first(h) for h in with_hits]
        return SampledRays(
            np.concatenate([h.z_m for h in hits] or [np.zeros(0)]),
            frozenset(int(p) for h in hits for p in h.parts),
            np.concatenate([h.normals for h in hits] or [np.zeros((0, 3))]),
            misses,
        )


class RaySampler:
    """Tests labels of pixels against a target at a record's pose; with a rolling shutter each row has its own pose."""

    def __init__(self, truth: Truth, target: Target) -> None:
        self._truth, self._target = truth, target
        self._casters: dict[int, RayOracle] = {}
        self._centres: dict[tuple[int, int], SampledRays] = {}
        self._around: dict[tuple[int, int], SampledRays] = {}
        self._drawable: dict[tuple[int, int], SampledRays] = {}

    def _caster(self, row: int) -> RayOracle:
        key = row if self._truth.row_poses else 0
        if key not in self._casters:
            self._casters[key] = ray_oracle(self._target, pose_of_row(self._truth, row))
        return self._casters[key]

    def agrees(self, pixel: IntArray, is_right: Callable[[SampledRays], bool]) -> bool:
        """Return True if a label agrees with the ray through a pixel's centre, with the rays around it, or with the
        triangles that a rasteriser may draw there after rounding.
        """
        radius_px = TOLERANCE_PX if self._truth.camera.distortion.is_none else TOLERANCE_LENS_PX
        if self._truth.row_poses:
            radius_px = max(radius_px, TOLERANCE_ROLLING_PX)
        return (
            is_right(self._rays_at(pixel, self._centres, OFFSETS_PX[:1]))
            or is_right(self._rays_at(pixel, self._around, OFFSETS_PX * radius_px))
            or is_right(self._rounded(pixel, radius_px))
        )

    def _rounded(self, pixel: IntArray, radius_px: float) -> SampledRays:
        """Return the surfaces that may be drawn at a pixel's centre after rounding the vertices around it."""
        key = (int(pixel[0]), int(pixel[1]))
        if key not in self._drawable:
            pixels = pixel + np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
            rays = rays_with_opencv(self._truth.camera, pixels)
            px_per_ray = np.linalg.inv(np.stack([rays[1] - rays[2], rays[3] - rays[4]], axis=1))
            triangles = self._caster(key[1]).triangles_near(rays[0], px_per_ray, radius_px)
            z_m = np.concatenate([triangles.nearest_m, triangles.farthest_m])
            parts = frozenset(int(p) for p in triangles.parts)
            self._drawable[key] = SampledRays(z_m, parts, np.zeros((0, 3)), not triangles.is_sure, triangles)
        return self._drawable[key]

    def _rays_at(
        self, pixel: IntArray, cache: dict[tuple[int, int], SampledRays], offsets_px: FloatArray
    ) -> SampledRays:
        key = (int(pixel[0]), int(pixel[1]))
        if key not in cache:
            caster = self._caster(key[1])
            rays = rays_with_opencv(self._truth.camera, pixel + offsets_px)
            cache[key] = SampledRays.from_hits([caster.hits(ray) for ray in rays])
        return cache[key]

    def part_pixels(self, margin_px: float = 1.0) -> IntArray:
        """Return (K, 2) pixels in the image at the centres of each part's largest triangles, visible or not."""
        pixels = self._caster((self._truth.camera.height_px - 1) // 2).largest_triangles()
        pixels = np.rint(self._truth.camera.project(np.insert(pixels, 2, 1.0, axis=1)))
        c = self._truth.camera
        low, high = margin_px, np.array([c.width_px, c.height_px]) - 1 - margin_px
        return pixels[np.all((pixels >= low) & (pixels <= high), axis=1)].astype(np.int64)


def _first(hits: Hits) -> Hits:
    """Return the first surface along a ray, with those coplanar with it."""
    if not len(hits.z_m):
        return hits
    n = int(np.searchsorted(hits.z_m, hits.z_m[0] * (1 + DEPTH_RELATIVE) + COPLANAR_M, side="right"))
    return Hits(hits.z_m[:n], hits.parts[:n], hits.normals[:n])


def sample_pixels(truth: Truth, mask: ByteArray, layers: Layers, sampler: RaySampler) -> IntArray:
    """Select (K, 2) pixels x, y to test: random ones on and next to the mask, and some on every part."""
    rng = np.random.default_rng([truth.seed, truth.frame_index, 0x1ABE1])
    n = N_ROLLING if truth.row_poses else N_SAMPLES
    on = nonzero_pixels(mask)
    near = np.asarray(cv2.dilate(mask, np.ones((9, 9), np.uint8)))
    beside_mask = nonzero_pixels(np.where(mask == 0, near, np.uint8(0)))
    samples = [
        group[rng.integers(0, len(group), m)] for group, m in ((on, n), (beside_mask, n // 4)) if len(group)
    ]
    if "parts" in layers and len(on) and not truth.row_poses:
        parts = layers["parts"][on[:, 1], on[:, 0]]
        order = rng.permutation(len(on))
        _, first = np.unique(parts[order], return_index=True)
        samples += [on[order[first]], sampler.part_pixels()]
    return np.concatenate(samples) if samples else np.zeros((0, 2), np.int64)
