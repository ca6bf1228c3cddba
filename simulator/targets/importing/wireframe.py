"""A wireframe proposed from creases: sharp and open edges chained into straight stretches.

Stretches carry the mean normals of the faces on their two sides, short and hidden ones are dropped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulator.arrays import FloatArray, IntArray, Vec3, vec3
from simulator.targets.importing.seen import times_seen
from simulator.targets.importing.topology import Body, EdgeTable, apart, edge_table
from simulator.targets.model import Edge

CREASE_COS = float(np.cos(np.deg2rad(30.0)))
BEND_COS = float(np.cos(np.deg2rad(35.0)))
"""A chain goes on through a vertex where it bends by less: rims of twelve or more sides are followed."""
STRAIGHT = 0.004
SHORTEST = 0.03
"""Shares of the craft: how far a stretch may leave its straight line, and how long it must be."""
BEVEL = 0.006
"""Share of the craft within which parallel edges are one."""
MOST_EDGES = 80
"""Tango drawn by hand has 61; with 200 proposed on its mesh the estimator found fewer poses than with 80."""
FEWEST_VIEWS = 2


@dataclass(frozen=True, eq=False)
class _Stretch:
    a: FloatArray
    b: FloatArray
    normals: FloatArray  # (1 or 2, 3)


def propose_wireframe(bodies: list[Body], extent: float) -> tuple[tuple[Edge, ...], int]:
    """Edges by length, the longest first, and how many more there were than are kept."""
    stretches = [s for b in bodies for s in _stretches(apart(b), extent)]
    stretches = [s for s in stretches if np.linalg.norm(s.b - s.a) >= SHORTEST * extent]
    # the longest first; rounded, so that equal lengths keep the order of the file
    stretches.sort(key=lambda s: -round(float(np.linalg.norm(s.b - s.a)) / extent, 5))
    stretches = _distinct(stretches[: 8 * MOST_EDGES], extent)[: 4 * MOST_EDGES]
    if not stretches:
        return (), 0
    middles = np.array([(1 - f) * s.a + f * s.b for s in stretches for f in (0.25, 0.5, 0.75)])
    seen = times_seen(bodies, middles).reshape(-1, 3).max(axis=1)
    visible = [s for s, n in zip(stretches, seen, strict=True) if n >= FEWEST_VIEWS]
    edges = tuple(
        Edge(name=f"edge_{k + 1:03d}", a_m=vec3(s.a), b_m=vec3(s.b), normals=_both_sides(s.normals))
        for k, s in enumerate(visible[:MOST_EDGES])
    )
    return edges, max(len(visible) - MOST_EDGES, 0)


def _both_sides(normals: FloatArray) -> tuple[Vec3, ...]:
    """Normals of the two faces; a sheet's rim is seen from either side."""
    rows = [vec3(n / np.linalg.norm(n)) for n in normals]
    return tuple(rows) if len(rows) == 2 else (rows[0], vec3(-np.asarray(rows[0])))


def crease_edges(body: Body, table: EdgeTable) -> tuple[IntArray, FloatArray, FloatArray]:
    """Sharp and open edges: ends (C, 2), normal left of the edge and right of it (C, 3), NaN where no face is."""
    unit = body.face_vectors
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    start, face = body.triangles.ravel(), np.arange(body.triangles.size) // 3
    h, k = table.pairs.T
    sharp = np.einsum("ij,ij->i", unit[face[h]], unit[face[k]]) < CREASE_COS
    ends = table.ends[table.pair_edge[sharp]]
    h, k = h[sharp], k[sharp]
    # the half-edge that runs from the lower vertex has its face on the left
    forward = start[h] == ends[:, 0]
    left = np.where(forward[:, None], unit[face[h]], unit[face[k]])
    right = np.where(forward[:, None], unit[face[k]], unit[face[h]])
    rim = table.ends[table.open]
    rim_face = unit[face[table.first[table.open]]]
    blank = np.full_like(rim_face, np.nan)
    return np.concatenate([ends, rim]), np.concatenate([left, rim_face]), np.concatenate([right, blank])


def _stretches(body: Body, extent: float) -> list[_Stretch]:
    ends, left, right = crease_edges(body, edge_table(body.triangles))
    if not len(ends):
        return []
    p = body.positions_m
    follow = _followers(p, ends, left, right)
    done = np.zeros(len(ends), bool)
    out: list[_Stretch] = []
    # chains that have an end first, so that only true rings are begun anywhere
    order = [k for k in range(len(ends)) if follow[k, 0] < 0 or follow[k, 1] < 0]
    for seed in [*order, *range(len(ends))]:
        if done[seed]:
            continue
        side = 1 if follow[seed, 0] < 0 or follow[seed, 1] >= 0 else 0
        chain = _walk(seed, side, ends, follow, done)
        out += _split(chain, p, ends, (left, right), STRAIGHT * extent)
    return out


def _followers(p: FloatArray, ends: IntArray, left: FloatArray, right: FloatArray) -> IntArray:
    """(C, 2) the edge that continues each edge at its two ends, -1 where none does: the straightest, mutually."""
    direction = p[ends[:, 1]] - p[ends[:, 0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    at: dict[int, list[tuple[int, int]]] = {}
    for k, (a, b) in enumerate(ends.tolist()):
        at.setdefault(a, []).append((k, 0))
        at.setdefault(b, []).append((k, 1))
    follow = np.full((len(ends), 2), -1)
    for here in at.values():
        pairs = []
        for i, (e, s) in enumerate(here):
            for f, r in here[i + 1 :]:
                # away from the vertex: opposite directions make a straight line
                away = direction[e] * (1 - 2 * s), direction[f] * (1 - 2 * r)
                cosine = -float(away[0] @ away[1])
                if cosine > BEND_COS and _same_faces(e, s, f, r, left, right):
                    pairs.append((-round(cosine, 6), e, s, f, r))
        taken: set[int] = set()
        for _, e, s, f, r in sorted(pairs):
            if e not in taken and f not in taken:
                follow[e, s], follow[f, r] = f, e
                taken |= {e, f}
    return follow


def _same_faces(e: int, s: int, f: int, r: int, left: FloatArray, right: FloatArray) -> bool:
    """Whether the faces beside two edges at one vertex look nearly alike."""
    one, other = (left[f], right[f]) if s != r else (right[f], left[f])
    for a, b in ((left[e], one), (right[e], other)):
        if np.isnan(a[0]) != np.isnan(b[0]):
            return False
        if not np.isnan(a[0]) and float(a @ b) < BEND_COS:
            return False
    return True


def _walk(seed: int, side: int, ends: IntArray, follow: IntArray, done: np.ndarray) -> list[tuple[int, bool]]:
    """Edges of a chain in order, each with whether it is run from its second end to its first."""
    chain, edge, out = [], seed, side
    while edge >= 0 and not done[edge]:
        done[edge] = True
        chain.append((edge, out == 0))
        vertex = ends[edge, out]
        edge_next = int(follow[edge, out])
        if edge_next >= 0:
            out = 1 if ends[edge_next, 0] == vertex else 0
        edge = edge_next
    return chain


def _split(
    chain: list[tuple[int, bool]],
    p: FloatArray,
    ends: IntArray,
    sides: tuple[FloatArray, FloatArray],
    tolerance: float,
) -> list[_Stretch]:
    """Straight stretches of a chain: cut at the farthest point until all are near (Douglas and Peucker 1973)."""
    first, backwards = chain[0]
    vertices = [int(ends[first, 1 if backwards else 0])]
    vertices += [int(ends[k, 0 if back else 1]) for k, back in chain]
    line = p[vertices]
    out, todo = [], [(0, len(chain))]
    while todo:
        i, j = todo.pop()
        chord = line[j] - line[i]
        length = float(np.linalg.norm(chord))
        offset = line[i : j + 1] - line[i]
        # a closed ring has no chord: cut it at its farthest point
        along = np.clip(offset @ chord / length**2, 0, 1) if length > tolerance else np.zeros(len(offset))
        away = np.linalg.norm(offset - along[:, None] * chord, axis=1)
        worst = int(np.argmax(away))
        if away[worst] > tolerance and 0 < worst < j - i:
            todo += [(i + worst, j), (i, i + worst)]
        elif length > 0:
            out.append(_Stretch(line[i], line[j], _mean_normals(chain[i:j], p, ends, sides)))
    return out


def _mean_normals(
    chain: list[tuple[int, bool]], p: FloatArray, ends: IntArray, sides: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """(1 or 2, 3) normals beside a stretch, its longer edges counting more."""
    total = np.zeros((2, 3))
    for k, backwards in chain:
        length = float(np.linalg.norm(p[ends[k, 1]] - p[ends[k, 0]]))
        for row, side in enumerate(sides[::-1] if backwards else sides):
            total[row] += length * np.nan_to_num(side[k])
    kept = total[np.linalg.norm(total, axis=1) > 0]
    return kept / np.linalg.norm(kept, axis=1, keepdims=True)


def _distinct(stretches: list[_Stretch], extent: float) -> list[_Stretch]:
    """The longest of those that run side by side within a bevel's width; it takes over the outermost normals.

    Bodies that touch have their common edges twice; a bevelled edge is two lines that no camera tells apart.
    """
    kept: list[_Stretch] = []
    for s in stretches:
        twin = next((k for k, t in enumerate(kept) if _beside(s, t, BEVEL * extent)), None)
        if twin is None:
            kept.append(s)
        else:
            t = kept[twin]
            kept[twin] = _Stretch(t.a, t.b, _widest(np.concatenate([t.normals, s.normals])))
    return kept


def _beside(s: _Stretch, t: _Stretch, reach: float) -> bool:
    """Whether both ends of ``s`` lie within ``reach`` of ``t``."""
    chord = t.b - t.a
    length2 = float(chord @ chord)
    for end in (s.a, s.b):
        along = min(max(float((end - t.a) @ chord) / length2, 0.0), 1.0)
        if float(np.linalg.norm(end - t.a - along * chord)) > reach:
            return False
    return True


def _widest(normals: FloatArray) -> FloatArray:
    """The two of some normals that look apart the most."""
    cosines = normals @ normals.T
    i, j = np.unravel_index(int(np.argmin(cosines)), cosines.shape)
    return normals[[i, j]] if i != j else normals[:1]
