"""Visibility baked on the nodes of a mesh's charts by ray casting: open sky or another face in each direction."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.baking.charts import Charts
    from flyaround.simulator.geometry.ray_cast import Int32Array, RayCaster
    from flyaround.simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

GRAZING = 0.12  # smallest cosine of a ray; flatter rays would hit neighbouring facets of a curved face
# shares of the craft's radius: distance of a ray's origin from its own face; and the larger one from a face covered by
# a decal, so that of a panel under cells or blankets only the gaps are visible
ORIGIN_OFFSET, DECAL_HEIGHT = 1e-4, 3e-3
_COVERED_SHARE = 0.4  # share of hidden directions above which a node is covered by a decal
_PROBE_STEP = 4  # every fourth direction is used to test whether a node is covered

# Maximum number of threads.
_MAX_THREADS = 8

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class NodeVisibility:
    """Visibility of each node of a mesh's charts in each direction.

    Parameters
    ----------
    directions : (D, 3) array
        Unit vectors, target frame.
    cosines : (N, D) array
        Cosines with the nodes' normals; zero if no ray was cast: below the face, or grazing it.
    is_open : (N, D) array
        True if a ray was cast and hit nothing.
    node : (K,) array
        Node of each ray that hit the craft.
    direction : (K,) array
        Direction of each ray that hit the craft.
    hit_node : (K,) array
        Node nearest to the hit.
    hit_back : (K,) array
        True if the ray hit the back of a face.
    """

    directions: FloatArray
    cosines: Float32Array
    is_open: BoolArray
    node: IntArray
    direction: IntArray
    hit_node: IntArray
    hit_back: BoolArray


def trace_visibility(
    charts: Charts, planes: Float32Array, caster: RayCaster, directions: FloatArray, radius_m: float
) -> NodeVisibility:
    """Cast rays from all nodes of a craft along all directions above their faces.

    Parameters
    ----------
    charts : Charts
        Charts of the mesh, with their nodes.
    planes : (T, 3) array
        Normals of the triangles.
    caster : RayCaster
        Ray caster of the mesh.
    directions : (D, 3) array
        Unit vectors.
    radius_m : float
        Radius of the craft.
    """
    face, cosines = _above(charts, planes, directions)
    covered, probed = _find_covered(charts.places_m, face, cosines, caster, directions, radius_m)
    origins = (
        charts.places_m + face * np.where(covered, DECAL_HEIGHT * radius_m, ORIGIN_OFFSET * radius_m)[:, None]
    )
    is_open = np.zeros(cosines.shape, bool)

    def along(k: int) -> tuple[IntArray, IntArray, BoolArray]:
        node = np.flatnonzero(cosines[:, k])
        if k in probed:  # uncovered nodes reuse the hits of the test
            distance, triangle = probed.pop(k)
            covered_nodes = np.flatnonzero(covered[node])
            distance[covered_nodes], triangle[covered_nodes] = caster.first_hits(
                origins[node[covered_nodes]], directions[k]
            )
        else:
            distance, triangle = caster.first_hits(origins[node], directions[k])
        is_open[node, k] = triangle < 0
        hit = np.flatnonzero(triangle >= 0)
        node, triangle = node[hit], triangle[hit]
        place = origins[node] + directions[k] * distance[hit, None]
        return node, charts.node_at(triangle, place), (planes @ directions[k])[triangle] > 0

    hits = _in_threads(along, range(len(directions)))
    node, hit_node, hit_back = (np.concatenate([f[k] for f in hits]) for k in range(3))
    return NodeVisibility(
        directions=directions,
        cosines=cosines,
        is_open=is_open,
        node=node,
        direction=np.repeat(np.arange(len(hits)), [len(f[0]) for f in hits]),
        hit_node=hit_node,
        hit_back=hit_back,
    )


def _above(charts: Charts, planes: Float32Array, directions: FloatArray) -> tuple[FloatArray, Float32Array]:
    """Return the (N, 3) normal of each node's face, and the cosines of `NodeVisibility`."""
    face = planes[charts.triangle].astype(float)
    sliver = np.abs(face).max(axis=1) < 0.5
    face[sliver] = charts.face_normals[charts.chart[sliver]]
    cosines = np.maximum(charts.normals.astype(np.float32) @ directions.T.astype(np.float32), 0)
    cosines *= (face @ directions.T) > GRAZING
    return face, cosines


def encode_visibility(visibility: NodeVisibility, patch: IntArray) -> NDArray[np.uint32]:
    """Encode (N, D) visibility as integers that compress well: 0 no ray, 1 open, from 2 on the patch that was hit.

    Parameters
    ----------
    visibility : NodeVisibility
        Visibility of the nodes.
    patch : (N,) array
        Patch of each node; patch p is coded as 2 + 2 p, and one more for its back.
    """
    codes = visibility.is_open.astype(np.uint32)
    codes[visibility.node, visibility.direction] = 2 + 2 * patch[visibility.hit_node] + visibility.hit_back
    return codes


def decode_visibility(
    codes: NDArray[np.integer],
    patch: IntArray,
    charts: Charts,
    planes: Float32Array,
    directions: FloatArray,
) -> NodeVisibility:
    """Decode `encode_visibility`, in the same order; each ``hit_node`` is its patch's first node."""
    direction, node = np.nonzero(codes.T > 1)
    hit_node = codes[node, direction].astype(np.int64) - 2
    _, first = np.unique(patch, return_index=True)
    return NodeVisibility(
        directions=directions,
        cosines=_above(charts, planes, directions)[1],
        is_open=codes == 1,
        node=node,
        direction=direction,
        hit_node=first[hit_node >> 1],
        hit_back=(hit_node & 1).astype(bool),
    )


def _find_covered(
    places_m: FloatArray,
    face: FloatArray,
    cosines: Float32Array,
    caster: RayCaster,
    directions: FloatArray,
    radius_m: float,
) -> tuple[BoolArray, dict[int, tuple[Float32Array, Int32Array]]]:
    """Return (N,) True where a decal hides most of a node's view, and the hits along the tested directions."""
    origins = places_m + face * (ORIGIN_OFFSET * radius_m)
    hits: dict[int, tuple[Float32Array, Int32Array]] = {}

    def low(k: int) -> Float32Array:
        node = np.flatnonzero(cosines[:, k])
        hits[k] = caster.first_hits(origins[node], directions[k])
        distance = hits[k][0]
        low = np.zeros(len(places_m), np.float32)
        low[node] = cosines[node, k] * (distance * (face[node] @ directions[k]) < DECAL_HEIGHT * radius_m)
        return low

    probed = range(0, len(directions), _PROBE_STEP)
    n_hidden = np.sum(_in_threads(low, probed), axis=0)
    return np.asarray(n_hidden > _COVERED_SHARE * cosines[:, probed].sum(axis=1)), hits


def _in_threads(function: Callable[[int], _T], numbers: range) -> list[_T]:
    """Map a function over directions in threads. Return results in order, independent of the number of threads."""
    with ThreadPoolExecutor(min(_MAX_THREADS, os.cpu_count() or 1)) as threads:
        return list(threads.map(function, numbers))
