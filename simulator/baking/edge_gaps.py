"""Gaps between edges that run side by side: the two sides of a slit, of a thin plate, of a strut."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cached_arrays import cached_array

if TYPE_CHECKING:
    from flyaround.simulator.baking.mesh_edges import MeshEdges
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

VERSION = 1  # of `_nearest_creases`: raise it when the same edges give other distances
_FARTHEST = 0.004  # of the mesh's extent: what lies farther apart is not looked for
_PLACES = 3, 12  # along an edge that are looked around from: at least, at most
_APART = 0.02  # of the mesh's extent, between those of a long edge
_LOOKED_AT = 6  # nearest places of other edges
_SAME_PLANE, _PARALLEL = 0.999, 0.95  # cosines
_BEYOND = 0.02  # of its length, by which an edge may end before the other's place
_SHORTEST = 0.003  # of the mesh's extent: shorter edges cost little
_MOST_EDGES = 200_000  # of a finer mesh no pairs are looked for


def edge_gaps(edges: MeshEdges) -> Float32Array:
    """(E, 2) gap between each edge and the creases that run beside all of its length, from the cache [m].

    The first is that to creases with a face as turned as the edge's first face, which show when that face does; the
    second that of the second face. Infinite where there are none, or none near.
    """
    return np.asarray(
        cached_array(entry_name("edge-gaps", VERSION, *_content(edges)), lambda: _nearest_creases(edges))
    )


def _content(edges: MeshEdges) -> tuple[FloatArray, IntArray, IntArray, BoolArray, FloatArray]:
    return edges.vertices_m, edges.ends, edges.faces, edges.is_crease, edges.planes


def _nearest_creases(edges: MeshEdges) -> Float32Array:
    found = np.full((len(edges.ends), 2), np.inf, np.float32)
    creases = np.flatnonzero(edges.is_crease)
    if not len(creases) or len(edges.ends) > _MOST_EDGES:
        return found
    start, end = np.moveaxis(edges.vertices_m[edges.ends], 1, 0)
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / length[:, None]
    extent = float(np.linalg.norm(np.ptp(edges.vertices_m, axis=0)))
    farthest, apart = _FARTHEST * extent, _APART * extent
    # places on the creases, close enough to each other that the nearest crease is among the nearest places
    of, share = _places(creases, np.ceil(length[creases] / farthest))
    tree = cKDTree(start[of] + share[:, None] * (end - start)[of])
    long = np.flatnonzero(length > _SHORTEST * extent)
    if not len(long):
        return found
    asked, at = _places(long, np.clip(np.ceil(length[long] / apart), *_PLACES))
    place = start[asked] + at[:, None] * (end - start)[asked]
    reach = np.hypot(farthest, farthest / 2)
    row = np.asarray(tree.query(place, k=_LOOKED_AT, distance_upper_bound=reach)[1])
    asking, column = np.nonzero(row < len(of))
    other, own = of[row[asking, column]], asked[asking]
    # beside it, not before its ends; about parallel; another edge
    to = place[asking] - start[other]
    step = np.einsum("ij,ij->i", to, along[other])
    good = (step >= -_BEYOND * length[other]) & (step <= (1 + _BEYOND) * length[other]) & (other != own)
    good &= np.abs(np.einsum("ij,ij->i", along[other], along[own])) > _PARALLEL
    asking, other, own, to, step = (v[good] for v in (asking, other, own, to, step))
    away = np.linalg.norm(to - step[:, None] * along[other], axis=1)
    normals = edges.planes[:, :3]
    for k in (0, 1):
        mine = normals[edges.faces[own, k]]
        same = np.zeros(len(own), bool)
        for other_face in edges.faces[other].T:
            same |= np.einsum("ij,ij->i", normals[other_face], mine) > _SAME_PLANE
        nearest = np.full(len(asked), np.inf)
        np.minimum.at(nearest, asking[same], away[same])
        starts = np.flatnonzero(np.diff(asked, prepend=-1))
        found[long, k] = np.maximum.reduceat(nearest, starts)
    return found


def _places(of: IntArray, counts: FloatArray) -> tuple[IntArray, FloatArray]:
    """Places along edges: the edge of each, and how far along it is [1]; so many evenly on each edge."""
    whole = np.maximum(counts, 1).astype(int)
    first = np.cumsum(whole) - whole
    rank = np.arange(whole.sum()) - np.repeat(first, whole)
    return np.repeat(of, whole), (rank + 0.5) / np.repeat(whole, whole)
