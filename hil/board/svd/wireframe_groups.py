"""Perceptual groups of the wireframe, in every order in which an image group can be matched with them.

Sharma, Ventura & D'Amico (2018), feature synthesis: the definitions are those of the image's groups
(``perceptual_groups``). They are computed once, before the first image.
"""

from __future__ import annotations

from typing import List, Tuple

import numpy as np

from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.svd.perceptual_groups import PARALLEL_OVERLAP, Chains, PointGroups, same_direction

Array = np.ndarray

# Minimum size of a wireframe group [share of the model's radius]. Smaller groups multiply the hypotheses, and their
# poses are less precise.
MIN_SIZE = 0.6

# Distance within which ends of edges meet [m]: wireframes model panels and body as separate boxes.
JOIN_M = 0.02

# Shortest side of a chain relative to its longest: with a shorter one it is nearly a corner.
MIN_SIDE_RATIO = 0.15

# Largest number of parallel pairs, and of edges among which they are searched, longest first: bounds the hypotheses.
MAX_PARALLEL_PAIRS, MAX_PARALLEL_EDGES = 120, 40

# Cosine of 2.6 degrees, within which edges or planes count as parallel.
PARALLEL_COSINE = 0.999

# Sine of 12 degrees, below which edges that meet form no corner.
MIN_CORNER_SINE = 0.2


def model_point_groups(model: BoardModel) -> PointGroups:
    """Return the groups of the wireframe, in every order in which an image group can be matched with them.

    The published wireframe holds panel, body and antennas only, so groups of smaller parts are omitted.
    """
    chains = model_triads(model)
    chains = _large(chains, MIN_SIZE * model.radius_m)
    # a closed face occurs once for each middle side and direction, which covers all its orders
    closed = chains.points[chains.closed]
    plain = [e for e in model.wireframe if e.radius_m == 0]
    ends = np.array([[e.a_m, e.b_m] for e in plain]).reshape(-1, 2, 3)
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 0.5 * MIN_SIZE * model.radius_m]
    rods = np.array([[e.a_m, e.b_m] for e in model.wireframe if e.radius_m > 0]).reshape(-1, 2, 3)
    corners = _model_corners(ends)
    return PointGroups(
        {
            "closed_tetrad": closed,
            "open_tetrad": np.concatenate([closed, closed[:, :1]], axis=1),
            "open_triad": chains.points,
            "proximity_pair": np.concatenate([corners, corners[:, ::-1]]),
            "parallel_pair": _model_parallel(ends),
            "antenna": np.concatenate([rods, rods[:, ::-1]]),
        }
    )


def _large(chains: Chains, least_m: float) -> Chains:
    keep = np.linalg.norm(np.ptp(chains.points, axis=1), axis=1) > least_m
    return Chains(chains.points[keep], chains.closed[keep])


def model_triads(model: BoardModel, join_m: float = JOIN_M) -> Chains:
    """Return planar chains of three wireframe edges bent to the same side, in both directions."""
    edges = [e for e in model.wireframe if e.radius_m == 0]
    n = len(edges)
    ends = np.array([[e.a_m, e.b_m] for e in edges]).reshape(n, 2, 3)
    points, closed = [], []
    for m in range(n):
        for mi in (0, 1):
            pa, pb = ends[m, mi], ends[m, 1 - mi]
            arms_a = _arms(ends, m, pa, join_m)
            arms_b = _arms(ends, m, pb, join_m)
            for i, fa in arms_a:
                for j, fb in arms_b:
                    if i == j:
                        continue
                    quad = np.array([fa, pa, pb, fb])
                    if _flat_convex(quad):
                        points.append(quad)
                        closed.append(_joined(ends, fa, fb, join_m))
    if not points:
        return Chains(np.zeros((0, 4, 3)), np.zeros(0, bool))
    return Chains(np.array(points), np.array(closed, bool))


def _arms(ends: Array, m: int, p: Array, join_m: float) -> List[Tuple[int, Array]]:
    near = np.linalg.norm(ends - p, axis=2) < join_m
    return [(int(k), ends[k, 1 - int(near[k].argmax())]) for k in np.flatnonzero(near.any(axis=1)) if k != m]


def _joined(ends: Array, a: Array, b: Array, join_m: float) -> bool:
    meets_a = np.linalg.norm(ends - a, axis=2) < join_m
    two = np.linalg.norm(ends - b, axis=2) < join_m
    return bool(np.any((meets_a[:, 0] & two[:, 1]) | (meets_a[:, 1] & two[:, 0])))


def _flat_convex(quad: Array) -> bool:
    """Return True for a planar chain whose arms lie on one side and which is not nearly a line."""
    side = np.linalg.norm(np.diff(quad, axis=0), axis=1)
    if side.min() < MIN_SIDE_RATIO * side.max():
        return False
    base = quad[2] - quad[1]
    n1, n2 = np.cross(quad[0] - quad[1], base), np.cross(quad[3] - quad[2], base)
    s = np.linalg.norm(n1) * np.linalg.norm(n2)
    return bool(s > 1e-9 and n1 @ n2 > PARALLEL_COSINE * s)


def _model_corners(ends: Array) -> Array:
    """Return far end, corner, far end (N, 3, 3) of edges that meet at an angle."""
    out: List[Array] = []
    for i in range(len(ends)):
        for j in range(i + 1, len(ends)):
            gap = np.linalg.norm(ends[i][:, None] - ends[j][None], axis=2)
            ei, ej = np.unravel_index(int(gap.argmin()), (2, 2))
            if gap[ei, ej] > JOIN_M:
                continue
            a, b = ends[i, 1 - ei] - ends[i, ei], ends[j, 1 - ej] - ends[j, ej]
            if np.linalg.norm(np.cross(a, b)) > MIN_CORNER_SINE * np.linalg.norm(a) * np.linalg.norm(b):
                out.append(np.stack([ends[i, 1 - ei], ends[i, ei], ends[j, 1 - ej]]))
    return np.array(out).reshape(-1, 3, 3)


def _model_parallel(ends: Array) -> Array:
    """Return overlapping parallel edges (N, 4, 3), longest first, in both senses and both orders."""
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    order = np.argsort(-length, kind="stable")[:MAX_PARALLEL_EDGES]
    out: List[Array] = []
    for x, i in enumerate(order):
        d = (ends[i, 1] - ends[i, 0]) / max(length[i], 1e-9)
        for j in order[x + 1 :]:
            e = ends[j, 1] - ends[j, 0]
            if abs(float(d @ e)) < PARALLEL_COSINE * length[j]:
                continue
            s = np.sort((ends[j] - ends[i, 0]) @ d)
            if min(s[1], length[i]) - max(s[0], 0.0) > PARALLEL_OVERLAP * length[j]:
                out.append(same_direction(ends[i], ends[j]))
    pairs = np.array(out[:MAX_PARALLEL_PAIRS]).reshape(-1, 4, 3)
    swapped = pairs[:, [2, 3, 0, 1]]
    both = np.concatenate([pairs, swapped])
    return np.concatenate([both, both[:, [1, 0, 3, 2]]])
