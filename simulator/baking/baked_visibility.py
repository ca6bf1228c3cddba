"""Visibility from the nodes of a mesh's charts, by ray casting: the open sky or another face in each direction."""

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

GRAZING = 0.12
"""Smallest cosine of a ray with its face's normal. Flatter rays would hit neighbouring facets of a curved face."""
ORIGIN_OFFSET, DECAL_HEIGHT = 1e-4, 3e-3
"""Height of a ray's origin above its face, over the craft's radius: normally, and on a face that is covered by a decal,
such as a panel under cells or blankets."""
_COVERED_SHARE = 0.4  # a node is covered if a decal hides more than this share of its directions
_PROBE_STEP = 4  # every fourth direction is tested for a decal
_MAX_THREADS = 8  # chosen by eye

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
        Charts of the craft.
    planes : (T, 3) array
        Normals of the triangles.
    caster : RayCaster
        Finds the first triangle on each ray.
    directions : (D, 3) array
        Unit vectors, target frame.
    radius_m : float
        Radius of the craft.
    """
    face, cosines = _cosines_above_face(charts, planes, directions)
    is_covered, probed = _find_covered(charts.places_m, face, cosines, caster, directions, radius_m)
    origins = (
        charts.places_m
        + face * np.where(is_covered, DECAL_HEIGHT * radius_m, ORIGIN_OFFSET * radius_m)[:, None]
    )
    is_open = np.zeros(cosines.shape, bool)

    def cast_rays(k: int) -> tuple[IntArray, IntArray, BoolArray]:
        node = np.flatnonzero(cosines[:, k])
        if k in probed:  # reuse the hits of the decal test, except for covered nodes
            distance, triangle = probed.pop(k)
            retraced = np.flatnonzero(is_covered[node])
            distance[retraced], triangle[retraced] = caster.first_hits(origins[node[retraced]], directions[k])
        else:
            distance, triangle = caster.first_hits(origins[node], directions[k])
        is_open[node, k] = triangle < 0
        hit = np.flatnonzero(triangle >= 0)
        node, triangle = node[hit], triangle[hit]
        hit_point_m = origins[node] + directions[k] * distance[hit, None]
        return node, charts.node_at(triangle, hit_point_m), (planes @ directions[k])[triangle] > 0

    hits = _in_threads(cast_rays, range(len(directions)))
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


def _cosines_above_face(
    charts: Charts, planes: Float32Array, directions: FloatArray
) -> tuple[FloatArray, Float32Array]:
    """Return the normal of each node's face (N, 3), and the cosines (N, D) of `NodeVisibility`."""
    face = planes[charts.triangle].astype(float)
    is_sliver = np.abs(face).max(axis=1) < 0.5
    face[is_sliver] = charts.face_normals[charts.chart[is_sliver]]
    cosines = np.maximum(charts.normals.astype(np.float32) @ directions.T.astype(np.float32), 0)
    cosines *= (face @ directions.T) > GRAZING
    return face, cosines


def encode_visibility(visibility: NodeVisibility, patch: IntArray) -> NDArray[np.uint32]:
    """Encode visibility as integers (N, D) that compress well: 0 for no ray, 1 for open, from 2 on the patch hit.

    Parameters
    ----------
    visibility : NodeVisibility
        Visibility of the nodes.
    patch : (N,) array
        Patch of each node. Patch p has the code 2 + 2 p, and its back 3 + 2 p.
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
        cosines=_cosines_above_face(charts, planes, directions)[1],
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
    """Return a mask (N,) of nodes whose view a decal hides, and the hits along the tested directions."""
    origins = places_m + face * (ORIGIN_OFFSET * radius_m)
    hits: dict[int, tuple[Float32Array, Int32Array]] = {}

    def hidden_cosines(k: int) -> Float32Array:
        node = np.flatnonzero(cosines[:, k])
        hits[k] = caster.first_hits(origins[node], directions[k])
        distance = hits[k][0]
        hidden = np.zeros(len(places_m), np.float32)
        hidden[node] = cosines[node, k] * (distance * (face[node] @ directions[k]) < DECAL_HEIGHT * radius_m)
        return hidden

    probed = range(0, len(directions), _PROBE_STEP)
    n_hidden = np.sum(_in_threads(hidden_cosines, probed), axis=0)
    return np.asarray(n_hidden > _COVERED_SHARE * cosines[:, probed].sum(axis=1)), hits


def _in_threads(function: Callable[[int], _T], numbers: range) -> list[_T]:
    """Map a function over directions in threads. Return results in order, independent of the number of threads."""
    with ThreadPoolExecutor(min(_MAX_THREADS, os.cpu_count() or 1)) as threads:
        return list(threads.map(function, numbers))
