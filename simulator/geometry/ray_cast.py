"""Ray casting: the first triangle along each of many rays, with Embree or a grid in NumPy.

The grid is a fallback where Embree is not installed. It is as exact but much slower, above all for rays that are not
parallel; tests compare the two.

References
----------
Wald et al. (2014), Embree: a kernel framework for efficient CPU ray tracing, ACM TOG 33(4).
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.geometry.directions import view_basis
from flyaround.simulator.geometry.plane_grid import PlaneGrid

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

_PAIRS = 2_000_000  # pairs of a ray and a triangle tested at once: 0.3 GB
_EDGE_ON_M2 = 1e-14  # twice the projected area below which a triangle hides nothing

Int32Array = np.typing.NDArray[np.int32]


class RayCaster(Protocol):
    """A mesh to cast rays at; thread-safe."""

    def first_hits(self, origins_m: FloatArray, directions: FloatArray) -> tuple[Float32Array, Int32Array]:
        """Find the first triangle along each ray.

        Parameters
        ----------
        origins_m : (K, 3) array
            Origins.
        directions : (K, 3) array
            Unit vectors, or one (3,) for all rays.

        Returns
        -------
        distance_m : (K,) array
            Distance to the triangle; undefined for rays that hit nothing.
        triangle : (K,) array
            Index of the triangle, -1 for none.
        """
        ...


def make_ray_caster(corners_m: FloatArray) -> RayCaster:
    """Return the fastest available ray caster.

    Parameters
    ----------
    corners_m : (T, 3, 3) array
        Corners of the triangles.

    Returns
    -------
    RayCaster
        Embree's where `has_embree`, or else one in NumPy.
    """
    return EmbreeCaster(corners_m) if has_embree() else GridCaster(corners_m)


def has_embree() -> bool:
    """Return True if the package embreex is installed.

    Returns
    -------
    bool
        False on Linux on ARM, for which there is no wheel.
    """
    return importlib.util.find_spec("embreex") is not None


class EmbreeCaster:
    """Ray casting by Embree, in single precision."""

    def __init__(self, corners_m: FloatArray) -> None:
        # imported here because it loads 40 MB of libraries
        from embreex.mesh_construction import TriangleMesh  # noqa: PLC0415
        from embreex.rtcore_scene import EmbreeScene  # noqa: PLC0415

        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.ascontiguousarray(corners_m, np.float32))
        # the tree is built at the first query, which is not thread-safe
        self.first_hits(np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]))

    def first_hits(self, origins_m: FloatArray, directions: FloatArray) -> tuple[Float32Array, Int32Array]:
        """Return the first hits; see `RayCaster`."""
        origins = np.ascontiguousarray(origins_m, np.float32)
        ray_directions = np.ascontiguousarray(
            np.broadcast_to(np.asarray(directions, np.float32), origins.shape)
        )
        hits = self._scene.run(origins, ray_directions, query="INTERSECT", output=1)
        return hits["tfar"], hits["primID"]


class GridCaster:
    """Ray casting by projecting the mesh along each direction in turn, in double precision."""

    def __init__(self, corners_m: FloatArray) -> None:
        self._corners = np.ascontiguousarray(np.asarray(corners_m, float).transpose(1, 2, 0))

    def first_hits(self, origins_m: FloatArray, directions: FloatArray) -> tuple[Float32Array, Int32Array]:
        """Return the first hits; see `RayCaster`."""
        origins = np.asarray(origins_m, float)
        unique_directions, ray_direction = np.unique(
            np.atleast_2d(np.asarray(directions, float)), axis=0, return_inverse=True
        )
        if len(unique_directions) == 1:
            return self._along(origins, unique_directions[0])
        distance, triangle = np.empty(len(origins), np.float32), np.empty(len(origins), np.int32)
        for k, direction in enumerate(unique_directions):
            rays = np.flatnonzero(ray_direction.ravel() == k)
            distance[rays], triangle[rays] = self._along(origins[rays], direction)
        return distance, triangle

    def _along(self, origins: FloatArray, direction: FloatArray) -> tuple[Float32Array, Int32Array]:
        axes = view_basis(direction)
        x, y, z = np.einsum("ac,kct->akt", axes, self._corners)
        grid = PlaneGrid.over(np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)]))
        origins = origins @ axes.T
        triangles, distance = np.full(len(origins), -1, np.int32), np.full(len(origins), np.inf, np.float32)
        candidates = np.cumsum(grid.counts(origins[:, :2]))
        batch_starts = np.searchsorted(candidates, np.arange(_PAIRS, candidates[-1:].sum(), _PAIRS))
        for batch in np.split(np.arange(len(origins)), batch_starts):
            ray, triangle = grid.at(origins[batch, :2])
            ray, triangle, distances = _hit_pairs(batch[ray], triangle, origins, x, y, z)
            order = np.lexsort((distances, ray))
            ray, first = np.unique(ray[order], return_index=True)
            triangles[ray], distance[ray] = triangle[order][first], distances[order][first]
        return distance, triangles


def _hit_pairs(
    ray: np.typing.NDArray[np.int64],
    triangle: np.typing.NDArray[np.int64],
    origins: FloatArray,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
) -> tuple[np.typing.NDArray[np.int64], np.typing.NDArray[np.int64], FloatArray]:
    """Return the pairs (P,) of a ray and a triangle that it hits, and the distances along the rays.

    Parameters
    ----------
    ray : (P,) array
        Index of each pair's ray.
    triangle : (P,) array
        Index of each pair's triangle.
    origins : (3, K) or (K, 3) array
        Ray origins.
    x : (3, T) array
        x of the triangles' corners, in axes along the rays.
    y : (3, T) array
        y of the corners.
    z : (3, T) array
        z of the corners, which increases along the rays.
    """
    ahead = z.max(axis=0)[triangle] > origins[ray, 2]
    ray, triangle = ray[ahead], triangle[ahead]
    dx, dy = x[:, triangle] - origins[ray, 0], y[:, triangle] - origins[ray, 1]
    weights = np.roll(dx, -1, 0) * np.roll(dy, -2, 0) - np.roll(dx, -2, 0) * np.roll(dy, -1, 0)
    area = weights.sum(axis=0)
    inside = np.flatnonzero((weights * np.sign(area) >= 0).all(axis=0) & (np.abs(area) > _EDGE_ON_M2))
    ray, triangle = ray[inside], triangle[inside]
    distances = (weights[:, inside] * z[:, triangle]).sum(axis=0) / area[inside] - origins[ray, 2]
    before = distances > 0
    return ray[before], triangle[before], distances[before]
