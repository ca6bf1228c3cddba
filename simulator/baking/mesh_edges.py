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

SMOOTH_COSINE = np.cos(np.radians(5.0))  # shading normals that differ by less across an edge hide it
FLAT_COSINE = 1 - 1e-6  # faces of one plane (0.08 degrees) never part at a silhouette
_PLACE_M = 1e-6  # corners nearer than this are one
_SEARCH_RADIUS = 0.004  # largest distance of two edges compared, as a share of the mesh's extent
_PLACES = 3, 12  # along an edge that are looked around from: at least, at most
_PLACE_SPACING = 0.02  # spacing of the places along a long edge, as a share of the mesh's extent
_NEIGHBOURS = 6  # nearest places of other edges
_SAME_PLANE_COSINE, _PARALLEL_COSINE = 0.999, 0.95  # cosines
_END_TOLERANCE = 0.02  # share of its length by which an edge may end before the other's place
_MIN_LENGTH = 0.003  # share of the mesh's extent: shorter edges cost little
_MAX_EDGES = 200_000  # pairs are not searched in finer meshes


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """Edges by their ends, with the faces that meet there; a border has the same face twice.

    Parameters
    ----------
    vertices_m : (V, 3) places, target frame. ends : (E, 2) places of each edge.
    faces : (E, 2) rows of ``planes``. is_crease : (E,) seen whenever one of its faces is.
    planes : (F, 4) of each face: unit normal, and its distance from the origin with the sign turned [m].
    materials : (E,) number of the part's material; negative where the first face lies to the right of the edge, seen
        from outside.
    is_closed : back faces are never seen, so that only edges of front faces are.
    """

    vertices_m: FloatArray
    ends: IntArray
    faces: IntArray
    is_crease: np.typing.NDArray[np.bool_]
    planes: FloatArray
    materials: IntArray
    is_closed: bool

    def take(self, order: IntArray) -> MeshEdges:
        """Return a selection or permutation of the edges."""
        return replace(
            self,
            ends=self.ends[order],
            faces=self.faces[order],
            is_crease=self.is_crease[order],
            materials=self.materials[order],
        )

    def cut(self, longest_m: float) -> tuple[MeshEdges, IntArray]:
        """Halve the edges until none is longer than this. Return them, and the original edge of each piece.

        The pieces of an edge follow each other, and end where `subdivision.subdivide` cuts the same edge of a triangle.
        """
        places, ends, of = self.vertices_m, self.ends, np.arange(len(self.ends))
        while True:
            start, end = ends.T
            long = np.flatnonzero(np.linalg.norm(places[start] - places[end], axis=-1) > longest_m)
            if not len(long):
                break
            middle = len(places) + np.arange(len(long))
            places = np.concatenate([places, (places[start[long]] + places[end[long]]) * 0.5])
            ends = np.concatenate([ends, np.stack([middle, end[long]], axis=1)])
            ends[long, 1] = middle
            of = np.concatenate([of, of[long]])
        order = np.argsort(of, kind="stable")
        return replace(self.take(of[order]), vertices_m=places, ends=ends[order]), of[order]

    def quads(self) -> Float32Array:
        """Return (E, 4, 8) vertices: both ends, the corner's number 0..3 (end = number // 2, side = number % 2), and
        the edge's entry in `materials`.
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
    numbers : of the materials, from 1.
    """
    vertices, ends, faces, creases, planes, materials = [], [], [], [], [], []
    first_vertex = first_face = 0
    for part in parts:
        places, edge, face, crease, plane, left = _of_part(part)
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


def _of_part(part: Part) -> tuple[FloatArray, IntArray, IntArray, BoolArray, FloatArray, BoolArray]:
    positions = part.positions_m.astype(float)
    triangles = np.asarray(part.triangles)
    _, first, place = np.unique(
        np.round(positions / _PLACE_M).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    place = place.ravel()
    corners = positions[triangles]
    planes = face_planes(corners)
    normal = planes[:, :3]
    table = edge_table(place[triangles])
    head, mate = table.first, table.first.copy()
    mate[table.pair_edge] = table.pairs[:, 1]
    # every side of every triangle, from its lower place to its higher
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    left = place[start] <= place[end]
    start, end = np.where(left, start, end), np.where(left, end, start)
    # shading normals on both sides, at both ends
    n = part.normals.astype(float)
    same = np.minimum(
        np.einsum("ij,ij->i", n[start[head]], n[start[mate]]),
        np.einsum("ij,ij->i", n[end[head]], n[end[mate]]),
    )
    crease = (same < SMOOTH_COSINE) | (table.count != 2)
    flat = np.einsum("ij,ij->i", normal[head // 3], normal[mate // 3]) > FLAT_COSINE
    keep = (crease | ~flat) & (table.ends[:, 0] != table.ends[:, 1])
    head, mate = head[keep], mate[keep]
    faces = np.stack([head, mate], axis=1) // 3
    return positions[first], table.ends[keep], faces, crease[keep], planes, left[head]


def edge_gaps(edges: MeshEdges) -> Float32Array:
    """Return the (E, 2) gap between each edge and the creases that run next to its whole length, from the cache [m].

    The first is that to creases with a face as turned as the edge's first face, which show when that face does; the
    second that of the second face. Infinite where there are none, or none near.
    """
    return np.asarray(
        cached_array(
            entry_name("edge-gaps", (_nearest_creases,), *_content(edges)), lambda: _nearest_creases(edges)
        )
    )


def _content(edges: MeshEdges) -> tuple[FloatArray, IntArray, IntArray, BoolArray, FloatArray]:
    return edges.vertices_m, edges.ends, edges.faces, edges.is_crease, edges.planes


def _nearest_creases(edges: MeshEdges) -> Float32Array:
    found = np.full((len(edges.ends), 2), np.inf, np.float32)
    creases = np.flatnonzero(edges.is_crease)
    if not len(creases) or len(edges.ends) > _MAX_EDGES:
        return found
    start, end = np.moveaxis(edges.vertices_m[edges.ends], 1, 0)
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / length[:, None]
    extent = float(np.linalg.norm(np.ptp(edges.vertices_m, axis=0)))
    farthest, apart = _SEARCH_RADIUS * extent, _PLACE_SPACING * extent
    # places on the creases, close enough to each other that the nearest crease is among the nearest places
    of, share = _places(creases, np.ceil(length[creases] / farthest))
    tree = cKDTree(start[of] + share[:, None] * (end - start)[of])
    long = np.flatnonzero(length > _MIN_LENGTH * extent)
    if not len(long):
        return found
    asked, at = _places(long, np.clip(np.ceil(length[long] / apart), *_PLACES))
    place = start[asked] + at[:, None] * (end - start)[asked]
    reach = np.hypot(farthest, farthest / 2)
    row = np.asarray(tree.query(place, k=_NEIGHBOURS, distance_upper_bound=reach)[1])
    asking, column = np.nonzero(row < len(of))
    other, own = of[row[asking, column]], asked[asking]
    # next to it, not beyond its ends; nearly parallel; another edge
    to = place[asking] - start[other]
    step = np.einsum("ij,ij->i", to, along[other])
    good = (
        (step >= -_END_TOLERANCE * length[other])
        & (step <= (1 + _END_TOLERANCE) * length[other])
        & (other != own)
    )
    good &= np.abs(np.einsum("ij,ij->i", along[other], along[own])) > _PARALLEL_COSINE
    asking, other, own, to, step = (v[good] for v in (asking, other, own, to, step))
    away = np.linalg.norm(to - step[:, None] * along[other], axis=1)
    normals = edges.planes[:, :3]
    for k in (0, 1):
        mine = normals[edges.faces[own, k]]
        same = np.zeros(len(own), bool)
        for other_face in edges.faces[other].T:
            same |= np.einsum("ij,ij->i", normals[other_face], mine) > _SAME_PLANE_COSINE
        nearest = np.full(len(asked), np.inf)
        np.minimum.at(nearest, asking[same], away[same])
        starts = np.flatnonzero(np.diff(asked, prepend=-1))
        found[long, k] = np.maximum.reduceat(nearest, starts)
    return found


def _places(of: IntArray, counts: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return evenly spaced points along edges: the edge of each, and its position along it [1]."""
    whole = np.maximum(counts, 1).astype(int)
    first = np.cumsum(whole) - whole
    rank = np.arange(whole.sum()) - np.repeat(first, whole)
    return np.repeat(of, whole), (rank + 0.5) / np.repeat(whole, whole)
