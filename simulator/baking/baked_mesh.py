"""The baked geometry of a target's mesh: charts, edges, occluders and hulls, cached."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from flyaround.simulator.baking.chart_cuts import cut_charts
from flyaround.simulator.baking.charts import Charts, make_charts
from flyaround.simulator.baking.mesh_edges import MeshEdges, find_edges
from flyaround.simulator.geometry.convex_shells import (
    BOX_SIZE,
    Boxes,
    ConvexShell,
    convex_bodies,
    largest_shells,
)
from flyaround.simulator.geometry.plane_grid import PlaneGrid
from flyaround.simulator.geometry.topology import edge_table
from flyaround.simulator.geometry.triangles import face_planes
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array
from flyaround.simulator.runtime.serialisation import pack, unpack
from flyaround.simulator.targets.joined_mesh import part_is_closed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray, IntArray
    from flyaround.simulator.targets.model import Part

# Layout of a vertex in the GPU's buffer.
VERTEX = np.dtype([("position_m", "<f4", 3), ("normal", "<f4", 3), ("material", "<f4")])
MAX_CACHED_TRIANGLES = 1_000_000  # larger meshes would take a gigabyte each on disk


@dataclass(frozen=True, eq=False, kw_only=True)
class BakedMesh:
    """Baked data of a target's mesh, before or after upload.

    Parameters
    ----------
    values : (V, 7) array
        Vertices in the layout of `VERTEX`.
    hull_m : (3, K) array
        Vertices of the parts' convex hulls, which contain the mesh, target frame [m]; nested hulls are omitted.
    hull_parts : array
        Index in ``hull_m`` of the first vertex of each hull after the first.
    center_m : array
        Centre of the bounding sphere, target frame [m].
    radius_m : float
        Radius of the bounding sphere [m].
    is_closed : bool
        True if every part consists of closed shells facing outwards.
    triangles : (T, 3) array
        Vertex indices.
    planes : (T, 4) array
        Unit normal and negative distance from the origin [m].
    boxes : Boxes
        Bounding boxes of neighbouring triangles.
    shells : tuple of ConvexShell
        Large convex bodies for occlusion culling.
    charts : Charts
        Layout of the faces in an atlas; the mesh is cut along the charts' borders.
    edges : MeshEdges
        Edges that may show as lines.
    """

    values: Float32Array
    hull_m: FloatArray
    hull_parts: IntArray
    center_m: FloatArray
    radius_m: float
    is_closed: bool
    triangles: np.typing.NDArray[np.uint32]
    planes: Float32Array
    boxes: Boxes
    shells: tuple[ConvexShell, ...]
    charts: Charts
    edges: MeshEdges

    @cached_property
    def plane_rows(self) -> Float32Array:
        """(4, T) ``planes`` in row-major order, for fast products with a vector."""
        return np.ascontiguousarray(self.planes.T)


@dataclass(frozen=True, eq=False, kw_only=True)
class Geometry(BakedMesh):
    """A baked mesh with the data uploaded next to its vertices; see `craft.mesh.GpuMesh`.

    Parameters
    ----------
    uv : (V, 2) array
        Texture coordinates, or (0, 2).
    """

    uv: Float32Array


# a cache entry refers to these types by index
_PACKED = (Geometry, Boxes, Charts, MeshEdges, ConvexShell)


@dataclass(frozen=True, eq=False)
class MergedParts:
    """The concatenated parts of a target.

    Parameters
    ----------
    vertices : (V,) array
        Vertices of dtype `VERTEX`.
    triangles : (T, 3) array
        Indices.
    uv : (V, 2) array
        Texture coordinates, or (0, 2) without textures.
    """

    vertices: np.typing.NDArray[np.void]
    triangles: np.typing.NDArray[np.uint32]
    uv: Float32Array


def geometry_of(
    merged: MergedParts, parts: Sequence[Part], numbers: Mapping[str, int], texel: float
) -> Geometry:
    """Bake the geometry of a target, or read it from the cache.

    Parameters
    ----------
    merged : MergedParts
        Parts of the target as one mesh.
    parts : sequence of Part
        Parts of the target in its own order.
    numbers : mapping
        Material numbers, from 1.
    texel : float
        Spacing of the nodes of baked light, as a share of the mesh's radius.

    Returns
    -------
    Geometry
        Geometry unpacked from its cache entry, also where it is new. Larger meshes than `MAX_CACHED_TRIANGLES` are not
        cached.
    """

    # always unpack, even without a cache, because another memory layout may change the order of summation
    def bake() -> ByteArray:
        return pack(_make(merged, parts, numbers, texel), *_PACKED)

    if len(merged.triangles) > MAX_CACHED_TRIANGLES:
        return unpack_geometry(bake())
    part_positions = [part.positions_m for part in parts]  # in the target's order, which merging may change
    functions = (_make, make_charts, cut_charts, find_edges, largest_shells, part_is_closed, pack)
    makers = (*functions, PlaneGrid, edge_table, face_planes)
    key = entry_name("geometry", makers, texel, merged.vertices, merged.triangles, merged.uv, part_positions)
    return unpack_geometry(cached_array(key, bake))


def unpack_geometry(packed: ByteArray) -> Geometry:
    """Unpack the geometry of a cache entry.

    Returns
    -------
    Geometry
        Geometry that `geometry_of` packed.
    """
    return unpack(packed, *_PACKED)


def _make(merged: MergedParts, parts: Sequence[Part], numbers: Mapping[str, int], texel: float) -> Geometry:
    hulls = outer_hulls([part.positions_m.astype(float) for part in parts if len(part.positions_m)])
    hull = np.concatenate(hulls)
    center = (hull.min(axis=0) + hull.max(axis=0)) / 2
    radius = float(np.linalg.norm(hull - center, axis=1).max())
    vertices = merged.vertices
    charts = make_charts(
        vertices["position_m"].astype(float),
        vertices["normal"].astype(float),
        vertices["material"],
        merged.triangles.astype(int),
        texel * radius,
    )
    own, triangles = vertices[charts.origin], charts.triangles
    corners = own["position_m"].astype(float)[triangles]
    closed = all(part_is_closed(part) for part in parts)
    return Geometry(
        values=own.view(np.float32).reshape(len(own), -1),
        uv=merged.uv[charts.origin] if len(merged.uv) else merged.uv,
        hull_m=np.ascontiguousarray(hull.T),
        hull_parts=np.cumsum([len(h) for h in hulls[:-1]]),
        center_m=center,
        radius_m=radius,
        is_closed=closed,
        triangles=triangles,
        planes=face_planes(corners).astype(np.float32),
        boxes=Boxes.about(corners, BOX_SIZE * radius),
        shells=largest_shells(
            convex_bodies([p.positions_m.astype(float)[p.triangles] for p in parts], radius), radius
        ),
        charts=charts,
        edges=find_edges(tuple(parts), numbers, is_closed=closed),
    )


_ROUNDING = 1e-9  # rounding tolerance of a point inside a hull, as a share of the hull's extent


def outer_hulls(parts_m: Sequence[FloatArray]) -> list[FloatArray]:
    """Return vertices (K, 3) of the convex hulls of some parts; a hull inside another one is omitted.

    Their union is that of all parts' hulls. The hull of a flat part is its bounding box.

    Parameters
    ----------
    parts_m : sequence of (N, 3) arrays
        Points of each part.
    """
    hulls = [_hull(points) for points in parts_m]
    lows, highs = (np.array([f(points, axis=0) for points, _ in hulls]) for f in (np.min, np.max))
    outer: list[int] = []
    # the largest first, so that one of two equal ones is kept
    for k in np.argsort(-np.prod(highs - lows, axis=1), kind="stable").tolist():
        enclosing = [n for n in outer if np.all(lows[n] <= lows[k]) and np.all(highs[n] >= highs[k])]
        if not any(_inside(hulls[k][0], hulls[n][1], highs[n] - lows[n]) for n in enclosing):
            outer.append(k)
    return [hulls[k][0] for k in sorted(outer)]


def _inside(points_m: FloatArray, planes: FloatArray, extent_m: FloatArray) -> bool:
    distance = points_m @ planes[:, :3].T + planes[:, 3]
    return bool(distance.max() <= _ROUNDING * extent_m.max())


def _hull(points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return vertices (K, 3) of the convex hull, or of the bounding box of flat points, and its planes (F, 4)."""
    try:
        hull = ConvexHull(points_m)
    except QhullError:
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        planes = np.column_stack([np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([-high, low])])
        return np.asarray(low + corners * (high - low)), planes
    return np.asarray(points_m[hull.vertices]), np.asarray(hull.equations)
