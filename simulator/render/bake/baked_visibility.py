"""What places on a craft see of it in directions all around, by rays."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from simulator.render.bake.charts import Charts
    from simulator.render.bake.ray_cast import Int32Array, Tracer
    from simulator.runtime.arrays import BoolArray, Float32Array, FloatArray, IntArray

GRAZING = 0.12  # cosine: flatter directions meet the neighbours of a facet that stands for a round face
# of the craft's radius: a place looks from so far off its face, which then does not hide it; and one that is covered by
# what is lower than relief looks from above that: of a sheet under cells or blankets only the gaps between them show
LIFT, RELIEF = 1e-4, 3e-3
_COVERED = 0.4  # of what a place sees
_PROBE = 4  # a part of the directions tells whether a place is covered
_MOST_THREADS = 8

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Seen:
    """What lies in each direction of each node of a mesh's charts.

    Parameters
    ----------
    directions : (D, 3) unit vectors, target frame.
    cosines : (N, D) with the nodes' normals; zero where nothing was looked for, below the face or grazing it.
    is_open : (N, D) something was looked for and nothing of the craft is there.
    node, direction : (K,) that looked and met something. met : (K,) node nearest to there.
    from_behind : (K,) what was met looks away.
    """

    directions: FloatArray
    cosines: Float32Array
    is_open: BoolArray
    node: IntArray
    direction: IntArray
    met: IntArray
    from_behind: BoolArray


def look_around(
    charts: Charts, planes: Float32Array, tracer: Tracer, directions: FloatArray, radius_m: float
) -> Seen:
    """Follow rays from all nodes of a craft along all directions above their faces.

    Parameters
    ----------
    planes : (T, 3) normals of the triangles. directions : (D, 3) unit vectors. radius_m : of the craft.
    """
    face, cosines = _above(charts, planes, directions)
    covered, probed = _covered(charts.places_m, face, cosines, tracer, directions, radius_m)
    origins = charts.places_m + face * np.where(covered, RELIEF * radius_m, LIFT * radius_m)[:, None]
    is_open = np.zeros(cosines.shape, bool)

    def along(k: int) -> tuple[IntArray, IntArray, BoolArray]:
        node = np.flatnonzero(cosines[:, k])
        if k in probed:  # those that look from where they did need not look again
            triangle, distance = probed.pop(k)
            again = np.flatnonzero(covered[node])
            triangle[again], distance[again] = tracer.first_hits(origins[node[again]], directions[k])
        else:
            triangle, distance = tracer.first_hits(origins[node], directions[k])
        is_open[node, k] = triangle < 0
        hit = np.flatnonzero(triangle >= 0)
        node, triangle = node[hit], triangle[hit]
        place = origins[node] + directions[k] * distance[hit, None]
        return node, charts.node_at(triangle, place), (planes @ directions[k])[triangle] > 0

    found = _in_threads(along, range(len(directions)))
    node, met, from_behind = (np.concatenate([f[k] for f in found]) for k in range(3))
    return Seen(
        directions=directions,
        cosines=cosines,
        is_open=is_open,
        node=node,
        direction=np.repeat(np.arange(len(found)), [len(f[0]) for f in found]),
        met=met,
        from_behind=from_behind,
    )


def _above(charts: Charts, planes: Float32Array, directions: FloatArray) -> tuple[FloatArray, Float32Array]:
    """(N, 3) normal of the face that each node lies on, and the cosines of `Seen`."""
    face = planes[charts.triangle].astype(float)
    sliver = np.abs(face).max(axis=1) < 0.5
    face[sliver] = charts.face_normals[charts.chart[sliver]]
    cosines = np.maximum(charts.normals.astype(np.float32) @ directions.T.astype(np.float32), 0)
    cosines *= (face @ directions.T) > GRAZING
    return face, cosines


def coded(seen: Seen, patch: IntArray) -> NDArray[np.uint32]:
    """(N, D) what each node sees, as numbers that pack well: 0 where it did not look, 1 open, 2 on a patch's front.

    Parameters
    ----------
    patch : (N,) of each node; 2 more for each, and 1 more for its back.
    """
    codes = seen.is_open.astype(np.uint32)
    codes[seen.node, seen.direction] = 2 + 2 * patch[seen.met] + seen.from_behind
    return codes


def decoded(
    codes: NDArray[np.integer],
    patch: IntArray,
    charts: Charts,
    planes: Float32Array,
    directions: FloatArray,
) -> Seen:
    """What was `coded`, in the same order; each ``met`` is its patch's first node."""
    direction, node = np.nonzero(codes.T > 1)
    met = codes[node, direction].astype(np.int64) - 2
    _, first = np.unique(patch, return_index=True)
    return Seen(
        directions=directions,
        cosines=_above(charts, planes, directions)[1],
        is_open=codes == 1,
        node=node,
        direction=direction,
        met=first[met >> 1],
        from_behind=(met & 1).astype(bool),
    )


def _covered(
    places_m: FloatArray,
    face: FloatArray,
    cosines: Float32Array,
    tracer: Tracer,
    directions: FloatArray,
    radius_m: float,
) -> tuple[BoolArray, dict[int, tuple[Int32Array, Float32Array]]]:
    """(N,) whether low relief hides most of what each place sees; and what was met along the directions asked for."""
    origins = places_m + face * (LIFT * radius_m)
    met: dict[int, tuple[Int32Array, Float32Array]] = {}

    def low(k: int) -> Float32Array:
        node = np.flatnonzero(cosines[:, k])
        met[k] = tracer.first_hits(origins[node], directions[k])
        distance = met[k][1]
        low = np.zeros(len(places_m), np.float32)
        low[node] = cosines[node, k] * (distance * (face[node] @ directions[k]) < RELIEF * radius_m)
        return low

    probed = range(0, len(directions), _PROBE)
    hidden = np.sum(_in_threads(low, probed), axis=0)
    return np.asarray(hidden > _COVERED * cosines[:, probed].sum(axis=1)), met


def _in_threads(function: Callable[[int], _T], numbers: range) -> list[_T]:
    """Results in order: a direction a thread, and what is found does not depend on how many threads there are."""
    with ThreadPoolExecutor(min(_MOST_THREADS, os.cpu_count() or 1)) as threads:
        return list(threads.map(function, numbers))
