"""Proposal of a wireframe from a mesh: sharp and open edges, chained into straight segments.

Segments are ranked by length, contrast and visibility, and the best are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.topology import (
    EdgeTable,
    MeshBody,
    edge_table,
    with_separate_components,
)
from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray, Vec3, vec3
from flyaround.simulator.targets.importing.propose.edge_contrast import edge_contrast
from flyaround.simulator.targets.importing.propose.rods import along_rods, find_rods
from flyaround.simulator.targets.model import Edge

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Material

CREASE_COS = float(np.cos(np.deg2rad(30.0)))  # cosine of the least angle between the normals at a sharp edge
BEND_COS = float(np.cos(np.deg2rad(35.0)))
"""Cosine of the largest bend within a chain: rims with at least twelve sides are followed."""
MAX_DEVIATION = 0.004  # largest deviation of a segment from its straight line, as a share of the craft
MIN_LENGTH = 0.03  # least length of a segment, as a share of the craft
MERGE_DISTANCE = 0.006
"""Distance within which parallel edges are merged, as a share of the craft."""
MIN_EDGES, MAX_EDGES = 40, 100  # limits on the number of proposed edges
MAX_EVALUATED_EDGES = 600  # longest segments whose visibility is computed
MIN_VISIBLE_SHARE = 0.04
"""Least visible share of an edge, over views and its length."""
MIN_CONTRAST = 0.1
"""Least mean brightness step across an edge, relative to the brightest surface."""
VISIBILITY_SHARE = 0.97
"""Share of the total rank (length times contrast times visibility) after which further edges are dropped."""
MAX_GAP = 0.06
"""Largest gap between collinear segments to be joined, as a share of the craft. Fittings cause such gaps."""
PARALLEL_COSINE = float(np.cos(np.deg2rad(1.0)))  # cosine between edges that count as parallel


@dataclass(frozen=True, eq=False)
class _Segment:
    a: FloatArray
    b: FloatArray
    normals: FloatArray  # (1 or 2, 3)


def propose_wireframe(
    bodies: list[MeshBody], extent: float, materials: Sequence[Material]
) -> tuple[tuple[Edge, ...], int]:
    """Propose edges in descending order of length times contrast times visibility.

    Slender round pieces of the mesh become rods.

    Parameters
    ----------
    bodies : list of MeshBody
        Welded meshes of the craft, model frame.
    extent : float
        Size of the craft [m].
    materials : sequence of Material
        Materials of the bodies, for the contrast.

    Returns
    -------
    tuple
        The proposed edges, and the number of edges that were dropped.
    """
    rods = [r for b in bodies for r in find_rods(b, extent)]
    segments = [s for b in bodies for s in _segments(with_separate_components(b), extent)]
    segments = [s for s in segments if np.linalg.norm(s.b - s.a) >= MIN_LENGTH * extent]
    if segments:
        is_on_rod = along_rods(rods, np.array([s.a for s in segments]), np.array([s.b for s in segments]))
        segments = [s for s, c in zip(segments, is_on_rod, strict=True) if not c]
    # longest first; rounded, because rounding errors must not change the order of equal lengths
    segments.sort(key=lambda s: -round(float(np.linalg.norm(s.b - s.a)) / extent, 5))
    segments = _join_collinear(_merge_parallel(segments[: 2 * MAX_EVALUATED_EDGES], extent), extent)[
        :MAX_EVALUATED_EDGES
    ]
    ends = np.array([(s.a, s.b) for s in segments] + [(r.a_m, r.b_m) for r in rods]).reshape(-1, 2, 3)
    if not len(ends):
        return (), 0
    depth = np.array([0.0] * len(segments) + [r.radius_m for r in rods])
    contrast_step, visibility = edge_contrast(bodies, materials, ends[:, 0], ends[:, 1], depth)
    # the contrast of a rod is that of its two outlines against the background, not of its axis
    contrast_step = np.where(depth > 0, np.maximum(contrast_step, 0.3), contrast_step)
    contrast = np.round(
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) * contrast_step * visibility / extent, 6
    )
    is_valid = np.flatnonzero((visibility >= MIN_VISIBLE_SHARE) & (contrast_step >= MIN_CONTRAST))
    is_valid = is_valid[np.argsort(-contrast[is_valid], kind="stable")]
    share = np.cumsum(contrast[is_valid]) / max(float(contrast[is_valid].sum()), 1e-12)
    count = int(np.clip(np.searchsorted(share, VISIBILITY_SHARE) + 1, MIN_EDGES, MAX_EDGES))
    edges = []
    for number, k in enumerate(is_valid[:count], start=1):
        name = f"edge_{number:03d}"
        if k >= len(segments):
            edges.append(replace(rods[k - len(segments)], name=name))
        else:
            s = segments[k]
            edges.append(Edge(name=name, a_m=vec3(s.a), b_m=vec3(s.b), normals=_both_sides(s.normals)))
    return tuple(edges), max(len(is_valid) - count, 0)


def _join_collinear(segments: list[_Segment], extent: float) -> list[_Segment]:
    """Join collinear segments that are separated by a small gap and have adjacent faces of similar orientation."""
    joined: list[_Segment] = []
    a, b = np.empty((len(segments), 3)), np.empty((len(segments), 3))
    for s in segments:
        n = len(joined)
        twin = next(
            (
                int(k)
                for k in np.flatnonzero(_in_line(a[:n], b[:n], s, extent))
                if _same_sides(joined[int(k)].normals, s.normals)
            ),
            None,
        )
        if twin is None:
            a[n], b[n] = s.a, s.b
            joined.append(s)
            continue
        t = joined[twin]
        ends = np.array([t.a, t.b, s.a, s.b])
        position = (ends - t.a) @ (t.b - t.a)
        # keep the normals of the longer segment, which comes first
        merged = _Segment(ends[int(np.argmin(position))], ends[int(np.argmax(position))], t.normals)
        joined[twin], a[twin], b[twin] = merged, merged.a, merged.b
    return joined


def _in_line(a: FloatArray, b: FloatArray, s: _Segment, extent: float) -> BoolArray:
    """Return a mask (K,) of the segments ``a`` to ``b`` (K, 3) that continue ``s`` in line, across a small gap."""
    chord, direction_s = b - a, s.b - s.a
    length = np.linalg.norm(chord, axis=1)
    direction = chord / length[:, None]
    parallel = np.abs(direction @ direction_s) > PARALLEL_COSINE * np.linalg.norm(direction_s)
    offset = np.stack([s.a - a, s.b - a], axis=1)
    position = np.einsum("kij,kj->ki", offset, direction)
    distance = np.linalg.norm(offset - position[..., None] * direction[:, None], axis=2).max(axis=1)
    gap = np.maximum(position.min(axis=1) - length, -position.max(axis=1))
    return np.asarray(parallel & (distance < MAX_DEVIATION * extent) & (gap < MAX_GAP * extent))


def _same_sides(first_normals: FloatArray, second_normals: FloatArray) -> bool:
    is_similar = first_normals @ second_normals.T > BEND_COS
    return bool(is_similar.any(axis=1).all() or is_similar.any(axis=0).all())


def _both_sides(normals: FloatArray) -> tuple[Vec3, ...]:
    """Return the normals of the two faces; the rim of a sheet is visible from both sides."""
    rows = [vec3(n / np.linalg.norm(n)) for n in normals]
    return tuple(rows) if len(rows) == 2 else (rows[0], vec3(-np.asarray(rows[0])))


def crease_edges(body: MeshBody, table: EdgeTable) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return sharp and open edges: ends (C, 2), normals left and right (C, 3), NaN without a face."""
    unit = body.face_vectors
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    start, face = body.triangles.ravel(), np.arange(body.triangles.size) // 3
    h, k = table.pairs.T
    sharp = np.einsum("ij,ij->i", unit[face[h]], unit[face[k]]) < CREASE_COS
    ends = table.ends[table.pair_edge[sharp]]
    h, k = h[sharp], k[sharp]
    # the half-edge from the lower vertex has its face on the left
    forward = start[h] == ends[:, 0]
    left = np.where(forward[:, None], unit[face[h]], unit[face[k]])
    right = np.where(forward[:, None], unit[face[k]], unit[face[h]])
    rim = table.ends[table.open]
    rim_face = unit[face[table.first[table.open]]]
    blank = np.full_like(rim_face, np.nan)
    return np.concatenate([ends, rim]), np.concatenate([left, rim_face]), np.concatenate([right, blank])


def _segments(body: MeshBody, extent: float) -> list[_Segment]:
    ends, left, right = crease_edges(body, edge_table(body.triangles))
    if not len(ends):
        return []
    p = body.positions_m
    follow = _followers(p, ends, left, right)
    is_used = np.zeros(len(ends), bool)
    out: list[_Segment] = []
    # start at the ends of open chains first; the remaining edges form closed rings, which may start at any edge
    order = [k for k in range(len(ends)) if follow[k, 0] < 0 or follow[k, 1] < 0]
    for first_edge in [*order, *range(len(ends))]:
        if is_used[first_edge]:
            continue
        side = 1 if follow[first_edge, 0] < 0 or follow[first_edge, 1] >= 0 else 0
        chain = _walk(first_edge, side, ends, follow, is_used)
        out += _split(chain, p, ends, (left, right), MAX_DEVIATION * extent)
    return out


def _followers(p: FloatArray, ends: IntArray, left: FloatArray, right: FloatArray) -> IntArray:
    """Return (C, 2) indices of the edges that continue each edge at its two ends, -1 for none.

    At a vertex, edges are paired greedily, the straightest pair first.
    """
    direction = p[ends[:, 1]] - p[ends[:, 0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    edges_at: dict[int, list[tuple[int, int]]] = {}
    for k, (a, b) in enumerate(ends.tolist()):
        edges_at.setdefault(a, []).append((k, 0))
        edges_at.setdefault(b, []).append((k, 1))
    follow = np.full((len(ends), 2), -1)
    for incident in edges_at.values():
        pairs = []
        for i, (e, s) in enumerate(incident):
            for f, r in incident[i + 1 :]:
                # both directions point away from the vertex, so they are opposite if the edges form a straight line
                outward = direction[e] * (1 - 2 * s), direction[f] * (1 - 2 * r)
                cosine = -float(outward[0] @ outward[1])
                if cosine > BEND_COS and _same_faces(e, s, f, r, left, right):
                    pairs.append((-round(cosine, 6), e, s, f, r))
        used_edges: set[int] = set()
        for _, e, s, f, r in sorted(pairs):
            if e not in used_edges and f not in used_edges:
                follow[e, s], follow[f, r] = f, e
                used_edges |= {e, f}
    return follow


def _same_faces(e: int, s: int, f: int, r: int, left: FloatArray, right: FloatArray) -> bool:
    """Return True if the faces beside two edges at one vertex have similar normals."""
    left_normal, right_normal = (left[f], right[f]) if s != r else (right[f], left[f])
    for a, b in ((left[e], left_normal), (right[e], right_normal)):
        if np.isnan(a[0]) != np.isnan(b[0]):
            return False
        if not np.isnan(a[0]) and float(a @ b) < BEND_COS:
            return False
    return True


def _walk(
    first_edge: int, side: int, ends: IntArray, follow: IntArray, visited: np.ndarray
) -> list[tuple[int, bool]]:
    """Return the edges of a chain in order, each with True if it is traversed backwards."""
    chain, edge, exit_end = [], first_edge, side
    while edge >= 0 and not visited[edge]:
        visited[edge] = True
        chain.append((edge, exit_end == 0))
        vertex = ends[edge, exit_end]
        edge_next = int(follow[edge, exit_end])
        if edge_next >= 0:
            exit_end = 1 if ends[edge_next, 0] == vertex else 0
        edge = edge_next
    return chain


def _split(
    chain: list[tuple[int, bool]],
    p: FloatArray,
    ends: IntArray,
    sides: tuple[FloatArray, FloatArray],
    tolerance: float,
) -> list[_Segment]:
    """Split a chain into straight stretches (Douglas and Peucker 1973)."""
    first, backwards = chain[0]
    vertices = [int(ends[first, 1 if backwards else 0])]
    vertices += [int(ends[k, 0 if back else 1]) for k, back in chain]
    line = p[vertices]
    segments, stack = [], [(0, len(chain))]
    while stack:
        i, j = stack.pop()
        chord = line[j] - line[i]
        length = float(np.linalg.norm(chord))
        offset = line[i : j + 1] - line[i]
        # a closed ring has no chord: split it at its farthest point
        position = np.clip(offset @ chord / length**2, 0, 1) if length > tolerance else np.zeros(len(offset))
        distance = np.linalg.norm(offset - position[:, None] * chord, axis=1)
        worst = int(np.argmax(distance))
        if distance[worst] > tolerance and 0 < worst < j - i:
            stack += [(i + worst, j), (i, i + worst)]
        elif length > 0:
            segments.append(_Segment(line[i], line[j], _mean_normals(chain[i:j], p, ends, sides)))
    return segments


def _mean_normals(
    chain: list[tuple[int, bool]], p: FloatArray, ends: IntArray, sides: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the (1 or 2, 3) normals beside a segment, weighted by edge length."""
    total = np.zeros((2, 3))
    for k, backwards in chain:
        length = float(np.linalg.norm(p[ends[k, 1]] - p[ends[k, 0]]))
        for row, side in enumerate(sides[::-1] if backwards else sides):
            total[row] += length * np.nan_to_num(side[k])
    nonzero = total[np.linalg.norm(total, axis=1) > 0]
    return nonzero / np.linalg.norm(nonzero, axis=1, keepdims=True)


def _merge_parallel(segments: list[_Segment], extent: float) -> list[_Segment]:
    """Merge segments that run side by side within a bevel's width.

    The longest is kept, with the two normals that differ most. Touching bodies duplicate their common edges, and a
    bevelled edge consists of two lines that a camera cannot resolve.
    """
    distinct: list[_Segment] = []
    a, b = np.empty((len(segments), 3)), np.empty((len(segments), 3))
    for s in segments:
        n = len(distinct)
        twins = np.flatnonzero(_is_near(a[:n], b[:n], s, MERGE_DISTANCE * extent))
        if len(twins) == 0:
            a[n], b[n] = s.a, s.b
            distinct.append(s)
        else:
            t = distinct[int(twins[0])]
            distinct[int(twins[0])] = _Segment(
                t.a, t.b, _most_different_pair(np.concatenate([t.normals, s.normals]))
            )
    return distinct


def _is_near(a: FloatArray, b: FloatArray, s: _Segment, reach: float) -> BoolArray:
    """Return a mask (K,) of the segments ``a`` to ``b`` (K, 3) that have both ends of ``s`` within ``reach``."""
    chord = b - a
    length2 = np.einsum("ij,ij->i", chord, chord)
    is_near = np.ones(len(a), bool)
    for end in (s.a, s.b):
        position = np.clip(np.einsum("ij,ij->i", end - a, chord) / length2, 0.0, 1.0)
        is_near &= np.linalg.norm(end - a - position[:, None] * chord, axis=1) <= reach
    return is_near


def _most_different_pair(normals: FloatArray) -> FloatArray:
    """Return the two normals that differ most."""
    cosines = normals @ normals.T
    i, j = np.unravel_index(int(np.argmin(cosines)), cosines.shape)
    return normals[[i, j]] if i != j else normals[:1]
