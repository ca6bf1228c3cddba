"""The edges of a mesh that can show as lines in a picture: creases, borders, and whatever turns into a silhouette."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import edge_table
from flyaround.simulator.geometry.triangles import face_planes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray
    from flyaround.simulator.targets.model import Part

SMOOTH_COSINE = np.cos(np.radians(5.0))  # shading normals that differ by less across an edge hide it
FLAT_COSINE = 1 - 1e-6  # faces of one plane (0.08 degrees) never part at a silhouette
_PLACE_M = 1e-6  # corners nearer than this are one


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """Edges by their ends, each with the faces that meet there; a border has one face twice.

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
        """Some of the edges, or all in another order."""
        return replace(
            self,
            ends=self.ends[order],
            faces=self.faces[order],
            is_crease=self.is_crease[order],
            materials=self.materials[order],
        )

    def cut(self, longest_m: float) -> tuple[MeshEdges, IntArray]:
        """The edges in halves of halves, none longer than this, and of each piece the edge that it is of.

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
        """(E, 4, 8) vertices: both ends, the corner's number 0..3 (end = number // 2, side = number % 2), and
        the edge's entry in `materials`.
        """
        out = np.empty((len(self.ends), 4, 8), np.float32)
        out[..., :3] = self.vertices_m[self.ends[:, 0], None]
        out[..., 3:6] = self.vertices_m[self.ends[:, 1], None]
        out[..., 6] = np.arange(4)
        out[..., 7] = self.materials[:, None]
        return out


def find_edges(parts: tuple[Part, ...], numbers: Mapping[str, int], *, is_closed: bool) -> MeshEdges:
    """Every edge of a mesh that can show.

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
