"""Rays through sampled pixels: what the mesh shows there, with the doubt of a raster's rounding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from flyaround.simulator.dataset.check.geometry import rays_with_opencv
from flyaround.simulator.dataset.check.mask_statistics import lit_pixels
from flyaround.simulator.dataset.check.ray_casting import Hits, RayCaster, ray_caster
from flyaround.simulator.dataset.check.row_poses import pose_of_row
from flyaround.simulator.imaging.rolling_shutter import BAND_PX

if TYPE_CHECKING:
    from flyaround.simulator.dataset.check.raster_tolerance import ShowableTriangles
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray, IntArray
    from flyaround.simulator.targets.model import Target

Layers = Mapping[str, NDArray[Any]]

N_SAMPLES = 32
N_ROLLING = 12  # a rolling shutter has a pose, and so a mesh to project, for each sample
# A raster rounds vertices to 1/256 px.
_RING = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], axis=1)
OFFSETS_PX = np.concatenate([[[0.0, 0.0]], 0.25 * _RING, 0.6 * _RING, _RING])
DOUBT_PX = 0.03
DOUBT_LENS_PX = 0.06  # a bent edge is drawn in straight pieces
DOUBT_ROLLING_PX = 0.03 + BAND_PX / 2  # its bands are drawn at their middle row's time
DEPTH_RELATIVE, DEPTH_M = 2e-5, 1e-4
COPLANAR_M = 1e-3


@dataclass(frozen=True, eq=False)
class SampledRays:
    """What rays about one pixel's centre meet first: depths, parts and normals (N, 3); whether one meets nothing.

    ``showable`` is what a raster's rounding may show there instead, when that was asked.
    """

    z_m: FloatArray
    parts: frozenset[int]
    normals: FloatArray
    misses: bool
    showable: ShowableTriangles | None = None

    @staticmethod
    def of(along: list[Hits]) -> SampledRays:
        """The first surfaces of some rays as one; at an outline every surface.

        There a raster's rounding may leave out the first and show the edge of what lies behind it.
        """
        found = [h for h in along if len(h.z_m)]
        misses = len(found) < len(along)
        hits = found if misses else [_first(h) for h in found]
        return SampledRays(
            np.concatenate([h.z_m for h in hits] or [np.zeros(0)]),
            frozenset(int(p) for h in hits for p in h.parts),
            np.concatenate([h.normals for h in hits] or [np.zeros((0, 3))]),
            misses,
        )


class RaySampler:
    """Asks a target at a record's pose about pixels; each row of a rolling shutter has a pose of its own."""

    def __init__(self, truth: Truth, target: Target) -> None:
        self._truth, self._target = truth, target
        self._casters: dict[int, RayCaster] = {}
        self._centers: dict[tuple[int, int], SampledRays] = {}
        self._about: dict[tuple[int, int], SampledRays] = {}
        self._near: dict[tuple[int, int], SampledRays] = {}

    def _caster(self, row: int) -> RayCaster:
        key = row if self._truth.row_poses else 0
        if key not in self._casters:
            self._casters[key] = ray_caster(self._target, pose_of_row(self._truth, row))
        return self._casters[key]

    def agrees(self, pixel: IntArray, is_right: Callable[[SampledRays], bool]) -> bool:
        """Whether a label is right by the ray through a pixel's centre, or with the rays just about it, or else with
        what a raster's rounding may show of the triangles there.
        """
        doubt_px = DOUBT_PX if self._truth.camera.distortion.is_none else DOUBT_LENS_PX
        if self._truth.row_poses:
            doubt_px = max(doubt_px, DOUBT_ROLLING_PX)
        return (
            is_right(self._ask(pixel, self._centers, OFFSETS_PX[:1]))
            or is_right(self._ask(pixel, self._about, OFFSETS_PX * doubt_px))
            or is_right(self._rounded(pixel, doubt_px))
        )

    def _rounded(self, pixel: IntArray, doubt_px: float) -> SampledRays:
        """What the triangles about a pixel's centre may show of themselves once their corners are rounded."""
        key = (int(pixel[0]), int(pixel[1]))
        if key not in self._near:
            at = pixel + np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
            rays = rays_with_opencv(self._truth.camera, at)
            px_per_ray = np.linalg.inv(np.stack([rays[1] - rays[2], rays[3] - rays[4]], axis=1))
            found = self._caster(key[1]).triangles_near(rays[0], px_per_ray, doubt_px)
            z_m = np.concatenate([found.nearest_m, found.farthest_m])
            parts = frozenset(int(p) for p in found.parts)
            self._near[key] = SampledRays(z_m, parts, np.zeros((0, 3)), not found.is_sure, found)
        return self._near[key]

    def _ask(
        self, pixel: IntArray, known: dict[tuple[int, int], SampledRays], offsets_px: FloatArray
    ) -> SampledRays:
        key = (int(pixel[0]), int(pixel[1]))
        if key not in known:
            caster = self._caster(key[1])
            rays = rays_with_opencv(self._truth.camera, pixel + offsets_px)
            known[key] = SampledRays.of([caster.hits(ray) for ray in rays])
        return known[key]

    def where_parts_should_be(self, margin_px: float = 1.0) -> IntArray:
        """(K, 2) pixels on the image at the middles of the largest triangles of each part, seen or not."""
        pixels = self._caster((self._truth.camera.height_px - 1) // 2).largest_triangles()
        pixels = np.rint(self._truth.camera.project(np.insert(pixels, 2, 1.0, axis=1)))
        c = self._truth.camera
        low, high = margin_px, np.array([c.width_px, c.height_px]) - 1 - margin_px
        return pixels[np.all((pixels >= low) & (pixels <= high), axis=1)].astype(np.int64)


def _first(hits: Hits) -> Hits:
    """The first surface along a ray, with those that lie on it."""
    if not len(hits.z_m):
        return hits
    n = int(np.searchsorted(hits.z_m, hits.z_m[0] * (1 + DEPTH_RELATIVE) + COPLANAR_M, side="right"))
    return Hits(hits.z_m[:n], hits.parts[:n], hits.normals[:n])


def sample_pixels(truth: Truth, mask: ByteArray, layers: Layers, sampler: RaySampler) -> IntArray:
    """(K, 2) pixels x, y to ask about: at random on the mask and beside it, where a part is and where it should be."""
    rng = np.random.default_rng([truth.seed, truth.frame_index, 0x1ABE1])
    n = N_ROLLING if truth.row_poses else N_SAMPLES
    on = lit_pixels(mask)
    near = np.asarray(cv2.dilate(mask, np.ones((9, 9), np.uint8)))
    beside = lit_pixels(np.where(mask == 0, near, np.uint8(0)))
    chosen = [group[rng.integers(0, len(group), m)] for group, m in ((on, n), (beside, n // 4)) if len(group)]
    if "parts" in layers and len(on) and not truth.row_poses:
        parts = layers["parts"][on[:, 1], on[:, 0]]
        order = rng.permutation(len(on))
        _, first = np.unique(parts[order], return_index=True)
        chosen += [on[order[first]], sampler.where_parts_should_be()]
    return np.concatenate(chosen) if chosen else np.zeros((0, 2), np.int64)
