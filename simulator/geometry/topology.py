"""Topology of a mesh: welding, edge tables, connected components, closed surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

GRID_BITS = 21
"""Bits per axis of the grid on which positions are compared: steps of half a millionth of the craft's size."""


@dataclass(eq=False, kw_only=True)
class MeshBody:
    """A triangle mesh with welded vertices.

    Parameters
    ----------
    name : str
        Name of the body in the file.
    positions_m : (V, 3) array
        Distinct positions, model frame.
    triangles : (F, 3) array
        Vertex indices.
    face_material : (F,) array
        Material index.
    corner_normals : (F, 3, 3) array, optional
        Normals from the file, or None.
    corner_uv : (F, 3, 2) array, optional
        Texture coordinates, NaN where missing; or None.
    """

    name: str
    positions_m: FloatArray
    triangles: IntArray
    face_material: IntArray
    corner_normals: FloatArray | None = None
    corner_uv: FloatArray | None = None

    def submesh(self, faces: BoolArray) -> MeshBody:
        """Return the body restricted to some faces.

        Returns
        -------
        MeshBody
            Body with the faces for which ``faces`` (F,) is True, in their order. Its positions are those of this body,
            not copied, with vertices that no face uses.
        """
        normals = None if self.corner_normals is None else self.corner_normals[faces]
        return MeshBody(
            name=self.name,
            positions_m=self.positions_m,
            triangles=self.triangles[faces],
            face_material=self.face_material[faces],
            corner_normals=normals,
            corner_uv=None if self.corner_uv is None else self.corner_uv[faces],
        )

    @property
    def face_vectors(self) -> FloatArray:
        """(F, 3) normals as long as twice the faces' areas [m2]."""
        return face_vectors(self.positions_m[self.triangles])


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """Edges of a triangle mesh; half-edge h runs from corner h % 3 of face h // 3 to the next corner.

    Parameters
    ----------
    ends : (E, 2) array
        Vertices, the lower number first.
    count : (E,) array
        Number of faces.
    balance : (E,) array
        Half-edges towards the higher vertex minus the others.
    first : (E,) array
        One half-edge of each edge.
    pairs : (P, 2) array
        Half-edges of the edges with exactly two faces.
    pair_edge : (P,) array
        Edge of each pair.
    """

    ends: IntArray
    count: IntArray
    balance: IntArray
    first: IntArray
    pairs: IntArray
    pair_edge: IntArray

    @property
    def open(self) -> BoolArray:
        """(E,) True for edges of one face."""
        return self.count == 1

    @property
    def non_manifold(self) -> BoolArray:
        """(E,) True for edges of three or more faces that are not the seam of touching bodies."""
        return (self.count > 2) & ((self.balance != 0) | (self.count % 2 == 1))


def used_vertices(triangles: IntArray, count: int) -> IntArray:
    """Find the vertices that triangles use.

    Returns
    -------
    (K,) array of int
        Distinct indices, ascending.
    """
    return np.flatnonzero(np.bincount(triangles.ravel(), minlength=count))


def weld(points: FloatArray, low: FloatArray, extent: float) -> tuple[FloatArray, IntArray]:
    """Merge points (N, 3) that are equal on a grid of 2^21 steps over ``extent``.

    Returns
    -------
    positions : (V, 3) array
        First point of each occupied cell, in the order of the cells.
    index : (N,) array of int
        Index of each point among them.
    """
    step = extent / (2**GRID_BITS - 2)
    cell = np.floor((points - low) / step + 0.5).astype(np.int64)
    key = (cell[:, 0] << (2 * GRID_BITS)) | (cell[:, 1] << GRID_BITS) | cell[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return points[first], inverse.ravel()


def edge_table(triangles: IntArray) -> EdgeTable:
    """Return the edges of (F, 3) triangles.

    Returns
    -------
    EdgeTable
        Distinct edges in ascending order of their ends, and their faces.
    """
    start = triangles.ravel()
    end = np.roll(triangles, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * (int(high.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    starts = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
    count = np.diff(np.append(starts, len(order)))
    sign = np.where(start < end, 1, -1)[order]
    first = order[starts]
    two_faces = np.flatnonzero(count == 2)
    pairs = np.stack([order[starts[two_faces]], order[starts[two_faces] + 1]], axis=1)
    return EdgeTable(
        np.stack([low[first], high[first]], axis=1),
        count,
        np.add.reduceat(sign, starts),
        first,
        pairs,
        two_faces,
    )


def is_closed(positions_m: FloatArray | Float32Array, triangles: IntArray) -> bool:
    """Return True if a mesh is a closed surface that faces outwards.

    Returns
    -------
    bool
        True if every edge is used equally often in each direction, and the signed volume is positive.
    """
    p = positions_m.astype(float)[triangles]
    if not np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) > 0:
        return False
    # merge corners at one position, whatever their normals; slivers may lose an edge by rounding
    _, position = np.unique(np.round(positions_m, 6), axis=0, return_inverse=True)
    edges = edge_table(position.ravel()[triangles])
    return not edges.balance[edges.ends[:, 0] != edges.ends[:, 1]].any()


def components(links: IntArray, count: int) -> tuple[int, IntArray]:
    """Find the connected components of ``count`` nodes with links (K, 2).

    Returns
    -------
    number : int
        Number of components.
    label : (count,) array of int
        Component of each node, from 0.
    """
    graph = coo_array((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(count, count))
    number, label = connected_components(graph, directed=False)
    return int(number), label.astype(np.int64)


def face_bodies(triangles: IntArray, table: EdgeTable) -> tuple[int, IntArray]:
    """Find the connected components of faces over manifold edges.

    Returns
    -------
    number : int
        Number of components.
    label : (F,) array of int
        Component of each face, from 0.
    """
    return components(table.pairs // 3, len(triangles))


def with_separate_components(body: MeshBody) -> MeshBody:
    """Return the body with vertices duplicated so that no two connected components share one.

    Returns
    -------
    MeshBody
        Copy with the triangles in their order, without unused vertices, normals and texture coordinates.
    """
    _, piece = face_bodies(body.triangles, edge_table(body.triangles))
    count = len(body.positions_m)
    distinct, index = np.unique(piece[:, None] * count + body.triangles, return_inverse=True)
    return MeshBody(
        name=body.name,
        positions_m=body.positions_m[distinct % count],
        triangles=index.reshape(-1, 3),
        face_material=body.face_material,
    )
