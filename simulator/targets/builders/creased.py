"""Free-form bodies: creased normals on welded triangles, slabs between grids, copies of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.builders.mesh import Mesh, unit
from flyaround.simulator.targets.builders.solids import CREASE_RAD

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray


def creased(points_m: ArrayLike, triangles: ArrayLike, crease_rad: float = float(CREASE_RAD)) -> Mesh:
    """A mesh from welded triangles: every corner takes the mean normal of its smooth neighbours.

    Parameters
    ----------
    points_m : (N, 3), each corner once. triangles : (M, 3), counter-clockwise from outside.
    crease_rad : faces that meet at more than this angle keep a sharp edge. Means are weighted by area.
    """
    p, t = np.asarray(points_m, float), np.asarray(triangles, np.int64)
    area = np.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]])
    flat = unit(area)
    vertex, face = t.reshape(-1), np.repeat(np.arange(len(t)), 3)
    order = np.argsort(vertex, kind="stable")
    vertex, face = vertex[order], face[order]
    start = np.searchsorted(vertex, vertex)
    count = np.searchsorted(vertex, vertex, side="right") - start
    # every pair of corners that share a vertex
    own = np.repeat(np.arange(len(vertex)), count)
    other = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(start, count)
    smooth = (flat[face[own]] * flat[face[other]]).sum(axis=1) > np.cos(crease_rad)
    total = np.zeros((len(vertex), 3))
    np.add.at(total, own[smooth], area[face[other[smooth]]])
    normals = np.empty_like(total)
    normals[order] = unit(total)
    corners = t.reshape(-1)
    key = np.column_stack([corners, np.round(normals * 1e7)]).astype(np.int64)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Mesh(p[corners[first]], normals[first], index.reshape(-1, 3))


def slab(top_m: FloatArray, bottom_m: FloatArray) -> Mesh:
    """A closed body between two grids (I, J, 3); ``top_m`` is seen from outside with I x J right-handed."""
    rows, columns = top_m.shape[:2]
    k = np.arange(rows * columns).reshape(rows, columns)
    cap = _quads(k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:])
    rim = np.concatenate([k[:, 0], k[-1, 1:], k[-2::-1, -1], k[0, -2:0:-1]])
    after = np.roll(rim, -1)
    below = rows * columns
    walls = _quads(rim + below, after + below, after, rim)
    triangles = np.concatenate([cap, cap[:, ::-1] + below, walls])
    return creased(np.concatenate([top_m.reshape(-1, 3), bottom_m.reshape(-1, 3)]), triangles)


def _quads(a: IntArray, b: IntArray, c: IntArray, d: IntArray) -> IntArray:
    a, b, c, d = (np.ravel(x) for x in (a, b, c, d))
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def copies(mesh: Mesh, rotations: ArrayLike, offsets_m: ArrayLike) -> Mesh:
    """Copies of a mesh, the k-th turned by ``rotations[k]`` (3, 3) and then moved by ``offsets_m[k]``."""
    R, d = np.asarray(rotations, float), np.asarray(offsets_m, float)
    n, size = len(d), len(mesh.positions_m)
    R = np.broadcast_to(R, (n, 3, 3))
    positions = np.einsum("kij,vj->kvi", R, mesh.positions_m) + d[:, None]
    normals = np.einsum("kij,vj->kvi", R, mesh.normals)
    triangles = mesh.triangles[None] + (size * np.arange(n))[:, None, None]
    return Mesh(positions.reshape(-1, 3), normals.reshape(-1, 3), triangles.reshape(-1, 3))
