"""The edges of a mesh that may be visible as lines: creases, borders, silhouettes; and the gaps between them.

A gap lies between edges that run side by side: the two sides of a slit, of a thin plate, of a strut.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.topology import edge_table
from flyaround.simulator.geometry.triangles import face_planes
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray
    from flyaround.simulator.targets.model import Part

# an edge with shading normals that differ by less is smooth, and not visible
SMOOTH_COSINE = np.cos(np.radians(5.0))
FLAT_COSINE = 1 - 1e-6  # faces in one plane (0.08 degrees) never form a silhouette
_COINCIDENCE_M = 1e-6  # corners nearer than this coincide
_SEARCH_RADIUS = 0.004  # largest distance between edges that are compared, relative to the mesh's extent
_SAMPLE_COUNTS = 3, 12  # least and largest number of sample points along an edge
_SAMPLE_SPACING = 0.02  # spacing of the points along a long edge, as a share of the mesh's extent
_NEIGHBOURS = 6  # nearest points of other edges to examine
# minimum cosine of the angle between normals of one plane, and between edges that count as parallel
_SAME_PLANE_COSINE, _PARALLEL_COSINE = 0.999, 0.95
_END_TOLERANCE = 0.02  # share of its length by which an edge may end before the point of the other
_MIN_LENGTH = 0.003  # length below which no gap of an edge is searched, as a share of the mesh's extent
_MAX_EDGES = 200_000  # number of edges above which a mesh's gaps are not searched


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """Edges by their ends, with the adjacent faces; a border has the same face twice.

    Parameters
    ----------
    vertices_m : (V, 3) array
        Positions, target frame.
    ends : (E, 2) array
        Vertices of each edge.
    faces : (E, 2) array
        Rows of ``planes``.
    is_crease : (E,) array
        True if the edge is visible whenever one of its faces is.
    planes : (F, 4) array
        Unit normal of each face, and its negated distance from the origin [m].
    materials : (E,) array
        Material number of the part; negative if the first face lies to the right of the edge, seen from outside.
    is_closed : bool
        True if back faces are never visible, so that only edges of front faces are.
    """

    vertices_m: FloatArray
    ends: IntArray
    faces: IntArray
    is_crease: np.typing.NDArray[np.bool_]
    planes: FloatArray
    materials: IntArray
    is_closed: bool

    def take(self, order: IntArray) -> MeshEdges:
        """Select or permute the edges.

        Returns
        -------
        MeshEdges
            Edges at the indices ``order``, of the same vertices.
        """
        return replace(
            self,
            ends=self.ends[order],
            faces=self.faces[order],
            is_crease=self.is_crease[order],
            materials=self.materials[order],
        )

    def cut(self, longest_m: float) -> tuple[MeshEdges, IntArray]:
        """Halve the edges until none is longer than ``longest_m``.

        Returns
        -------
        edges : MeshEdges
            Pieces; those of an edge are consecutive, and end where `subdivision.subdivide` cuts the same edge of a
            triangle.
        original : (E,) array
            Index of the original edge of each piece, ascending.
        """
        places, ends, original = self.vertices_m, self.ends, np.arange(len(self.ends))
        while True:
            start, end = ends.T
            long = np.flatnonzero(np.linalg.norm(places[start] - places[end], axis=-1) > longest_m)
            if not len(long):
                break
            middle = len(places) + np.arange(len(long))
            places = np.concatenate([places, (places[start[long]] + places[end[long]]) * 0.5])
            ends = np.concatenate([ends, np.stack([middle, end[long]], axis=1)])
            ends[long, 1] = middle
            original = np.concatenate([original, original[long]])
        order = np.argsort(original, kind="stable")
        return replace(self.take(original[order]), vertices_m=places, ends=ends[order]), original[order]

    def quads(self) -> Float32Array:
        """Return the vertices of quadrilaterals along the edges.

        Returns
        -------
        (E, 4, 8) array
            Both ends of the edge [m], the corner's number 0..3 (end = number // 2, side = number % 2), and the edge's
            entry in `materials`.
        """
        out = np.empty((len(self.ends), 4, 8), np.float32)
        out[..., :3] = self.vertices_m[self.ends[:, 0], None]
        out[..., 3:6] = self.vertices_m[self.ends[:, 1], None]
        out[..., 6] = np.arange(4)
        out[..., 7] = self.materials[:, None]
        return out


def find_edges(parts: tuple[Part, ...], numbers: Mapping[str, int], *, is_closed: bool) -> MeshEdges:
    """Return every edge of a mesh that may be visible.

    Parameters
    ----------
    parts : tuple of Part
        Parts of the target.
    numbers : mapping
        Material numbers, from 1.
    is_closed : bool
        True if the mesh encloses a volume.
    """
    vertices, ends, faces, creases, planes, materials = [], [], [], [], [], []
    first_vertex = first_face = 0
    for part in parts:
        places, edge, face, crease, plane, left = _edges_of_part(part)
        materials.append(np.where(left, 1, -1) * numbers[part.material])
        vertices.append(places)
        ends.append(edge + first_vertex)
        faces.append(face + first_face)
        creases.append(crease)
        planes.append(plane)
        first_vertex += len(places)
        first_face += len(plane)
    return MeshEdges(
        np.concatenate(vertices),
        np.concatenate(ends),
        np.concatenate(faces),
        np.concatenate(creases),
        np.concatenate(planes),
        np.concatenate(materials),
        is_closed,
    )


def _edges_of_part(part: Part) -> tuple[FloatArray, IntArray, IntArray, BoolArray, FloatArray, BoolArray]:
    positions = part.positions_m.astype(float)
    triangles = np.asarray(part.triangles)
    _, first, vertex_index = np.unique(
        np.round(positions / _COINCIDENCE_M).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    vertex_index = vertex_index.ravel()
    corners = positions[triangles]
    planes = face_planes(corners)
    normal = planes[:, :3]
    table = edge_table(vertex_index[triangles])
    head, twin = table.first, table.first.copy()
    twin[table.pair_edge] = table.pairs[:, 1]
    # every side of every triangle, from its lower vertex to its higher one
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    is_forward = vertex_index[start] <= vertex_index[end]
    start, end = np.where(is_forward, start, end), np.where(is_forward, end, start)
    # shading normals on both sides, at both ends
    n = part.normals.astype(float)
    same = np.minimum(
        np.einsum("ij,ij->i", n[start[head]], n[start[twin]]),
        np.einsum("ij,ij->i", n[end[head]], n[end[twin]]),
    )
    crease = (same < SMOOTH_COSINE) | (table.count != 2)
    flat = np.einsum("ij,ij->i", normal[head // 3], normal[twin // 3]) > FLAT_COSINE
    keep = (crease | ~flat) & (table.ends[:, 0] != table.ends[:, 1])
    head, twin = head[keep], twin[keep]
    faces = np.stack([head, twin], axis=1) // 3
    return positions[first], table.ends[keep], faces, crease[keep], planes, is_forward[head]


def edge_gaps(edges: MeshEdges) -> Float32Array:
    """Return the gap between each edge and the creases that run next to its whole length, from the cache.

    Returns
    -------
    (E, 2) array
        Gap [m]. Column k is that to the nearest crease that is visible whenever face k of the edge is visible, infinite
        if there is none nearby.
    """
    return np.asarray(
        cached_array(
            entry_name("edge-gaps", (_nearest_creases,), *_content(edges)), lambda: _nearest_creases(edges)
        )
    )


def _content(edges: MeshEdges) -> tuple[FloatArray, IntArray, IntArray, BoolArray, FloatArray]:
    return edges.vertices_m, edges.ends, edges.faces, edges.is_crease, edges.planes


def _nearest_creases(edges: MeshEdges) -> Float32Array:
    gap_m = np.full((len(edges.ends), 2), np.inf, np.float32)
    creases = np.flatnonzero(edges.is_crease)
    if not len(creases) or len(edges.ends) > _MAX_EDGES:
        return gap_m
    start, end = np.moveaxis(edges.vertices_m[edges.ends], 1, 0)
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / length[:, None]
    extent = float(np.linalg.norm(np.ptp(edges.vertices_m, axis=0)))
    max_distance, distances = _SEARCH_RADIUS * extent, _SAMPLE_SPACING * extent
    # points on the creases, so dense that the nearest crease is among the nearest points
    crease_of_point, share = _places(creases, np.ceil(length[creases] / max_distance))
    tree = cKDTree(start[crease_of_point] + share[:, None] * (end - start)[crease_of_point])
    long = np.flatnonzero(length > _MIN_LENGTH * extent)
    if not len(long):
        return gap_m
    sampled, fraction = _places(long, np.clip(np.ceil(length[long] / distances), *_SAMPLE_COUNTS))
    position = start[sampled] + fraction[:, None] * (end - start)[sampled]
    search_radius = np.hypot(max_distance, max_distance / 2)
    row = np.asarray(tree.query(position, k=_NEIGHBOURS, distance_upper_bound=search_radius)[1])
    sample, column = np.nonzero(row < len(crease_of_point))
    other, edge_index = crease_of_point[row[sample, column]], sampled[sample]
    # beside it, not beyond its ends; nearly parallel; another edge
    offset = position[sample] - start[other]
    step = np.einsum("ij,ij->i", offset, along[other])
    is_valid = (
        (step >= -_END_TOLERANCE * length[other])
        & (step <= (1 + _END_TOLERANCE) * length[other])
        & (other != edge_index)
    )
    is_valid &= np.abs(np.einsum("ij,ij->i", along[other], along[edge_index])) > _PARALLEL_COSINE
    sample, other, edge_index, offset, step = (v[is_valid] for v in (sample, other, edge_index, offset, step))
    away = np.linalg.norm(offset - step[:, None] * along[other], axis=1)
    normals = edges.planes[:, :3]
    for k in (0, 1):
        own_normal = normals[edges.faces[edge_index, k]]
        same = np.zeros(len(edge_index), bool)
        for other_face in edges.faces[other].T:
            same |= np.einsum("ij,ij->i", normals[other_face], own_normal) > _SAME_PLANE_COSINE
        nearest = np.full(len(sampled), np.inf)
        np.minimum.at(nearest, sample[same], away[same])
        starts = np.flatnonzero(np.diff(sampled, prepend=-1))
        gap_m[long, k] = np.maximum.reduceat(nearest, starts)
    return gap_m


def _places(edges: IntArray, counts: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return evenly spaced points along edges: the edge of each point, and its position along the edge [1]."""
    n_samples = np.maximum(counts, 1).astype(int)
    first = np.cumsum(n_samples) - n_samples
    rank = np.arange(n_samples.sum()) - np.repeat(first, n_samples)
    return np.repeat(edges, n_samples), (rank + 0.5) / np.repeat(n_samples, n_samples)
