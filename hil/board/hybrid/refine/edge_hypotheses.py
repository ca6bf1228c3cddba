"""Alignment of hundreds of poses on the edges of a region, coarse to fine, and their edge support.

The number of poses falls from 400 to 130, to 50, and to 14 or 48 (docs/lab/2026-11-estimator.md).
"""

from __future__ import annotations

from typing import List, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.hypotheses.edge_support import quick_cost, support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.edge_search import RegionEdges
from flyaround.hil.board.hybrid.propose.variants import near_symmetries, neighbours
from flyaround.hil.board.hybrid.refine.edges import align_to_field

Array = np.ndarray

# Number of poses scored with exact visibility, for decisions by edges and by the whole image.
EDGES_DECIDE, IMAGE_DECIDES = 48, 14

# Poses that differ by less are duplicates [rad, share of the range].
DUPLICATE_RAD, DUPLICATE_SHARE = 0.07, 0.03

# Reach of the edge search in each step [field px], and number of poses kept afterwards, coarse to fine.
COARSE_REACH, COARSE_KEEP = ((14.0, 11.0), (9.0, 7.0, 6.0)), (130, 50)
FINE_REACH, SYMMETRY_REACH, SYMMETRIES_KEEP = (10.0, 8.0, 6.0, 5.0), (10.0, 8.0, 6.0, 5.0, 4.0), 18

# Distance at which the cost of an edge saturates [field px], and stride of the samples in the first steps.
CAPS_PX, STRIDE = (8.0, 6.0), 2

# Number of best poses whose near-symmetries and whose neighbours are aligned for decisions by edges.
SYMMETRIES_OF, NEIGHBOURS_OF = 3, 4


def refine_by_edges(
    target: PreparedTarget, frame: Observation, edges: RegionEdges, q: Array, t: Array
) -> List[Hypothesis]:
    """Return hypotheses of one region from poses q (N, 4), t (N, 3), aligned on its edges, best first."""
    coarse, fine = edges.coarse, edges.fine
    if not len(q):
        return []
    q, t = align_to_field(target, q, t, edges.views, coarse, COARSE_REACH[0], STRIDE)
    q, t = distinct(q, t, quick_cost(target, q, t, edges.views, coarse, CAPS_PX[0], STRIDE), COARSE_KEEP[0])
    q, t = align_to_field(target, q, t, edges.views, coarse, COARSE_REACH[1], STRIDE)
    q, t = distinct(q, t, quick_cost(target, q, t, edges.views, coarse, CAPS_PX[1]), COARSE_KEEP[1])
    q, t = align_to_field(target, q, t, edges.views, fine, FINE_REACH)
    keep = EDGES_DECIDE if target.model.faces is None else IMAGE_DECIDES
    q, t = distinct(q, t, quick_cost(target, q, t, edges.views, fine, CAPS_PX[1]), keep)
    frame.mark("edge_alignment")
    out = _judge(target, q, t, edges)
    frame.mark("edge_support")
    if target.model.faces is None:
        # with faces, near-symmetries are later compared on the whole image
        about = near_symmetries(target, out[:SYMMETRIES_OF]) + neighbours(target, out[:NEIGHBOURS_OF])
        if about:
            q, t = np.array([h.q for h in about]), np.array([h.t for h in about])
            q, t = align_to_field(target, q, t, edges.views, fine, SYMMETRY_REACH)
            q, t = distinct(q, t, quick_cost(target, q, t, edges.views, fine, CAPS_PX[1]), SYMMETRIES_KEEP)
            out += _judge(target, q, t, edges)
            out.sort(key=lambda h: -h.support.total)
        frame.mark("edge_alignment")
    frame.count("candidates", len(out))
    return out


def distinct(q: Array, t: Array, cost: Array, keep: int) -> Tuple[Array, Array]:
    """Return the ``keep`` poses of minimum cost, without near-duplicates."""
    indices: List[int] = []
    for i in np.argsort(cost):
        if not np.isfinite(cost[i]):
            continue
        if indices:
            near = quat.angle_rad(q[indices], q[i]) < DUPLICATE_RAD
            near &= np.linalg.norm(t[indices] - t[i], axis=1) < DUPLICATE_SHARE * abs(t[i, 2])
            if near.any():
                continue
        indices.append(int(i))
        if len(indices) >= keep:
            break
    return q[indices], t[indices]


def _judge(target: PreparedTarget, q: Array, t: Array, edges: RegionEdges) -> List[Hypothesis]:
    """Return hypotheses with their support by the fine edges, best first."""
    source, out = Source(edges.region, edges.fine), []
    for k in range(len(q)):
        s = support(target, q[k], t[k], edges.fine)
        out.append(Hypothesis(PoseFit(q[k], t[k]), source, s.total, s))
    out.sort(key=lambda h: -h.score)
    return out
