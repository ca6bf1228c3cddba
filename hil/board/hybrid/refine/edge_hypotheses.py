"""Alignment of the poses proposed by edges, coarse to fine, and their edge support.

About 400 poses of a region are aligned on its edges. After each step only the best distinct poses are kept: 130, 50,
then 14 or 48 (docs/lab/2026-11-estimator.md, The stages).
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

# All values below are hand-tuned on the development frames of docs/lab/2026-11-estimator.md.

# Poses that differ by less are duplicates: attitude [rad], and position as a share of the range.
DUPLICATE_RAD = 0.07
DUPLICATE_SHARE = 0.03

# Distance within which edges attract a pose, one Gauss-Newton step per entry [field px].
FIRST_COARSE_REACH_PX = (14.0, 11.0)
SECOND_COARSE_REACH_PX = (9.0, 7.0, 6.0)
FINE_REACH_PX = (10.0, 8.0, 6.0, 5.0)
VARIANT_REACH_PX = (*FINE_REACH_PX, 4.0)

# Number of poses kept after each coarse alignment.
FIRST_COARSE_POSES = 130
SECOND_COARSE_POSES = 50

# Number of poses kept after the fine alignment. Edges alone decide on a target without faces, so more are compared.
FINE_POSES = 14
FINE_POSES_WITHOUT_FACES = 48

# Distance at which the cost of an edge saturates [field px].
FIRST_CAP_PX = 8.0
CAP_PX = 6.0

# Stride through the edge samples in the coarse alignments, for speed.
COARSE_STRIDE = 2

# Number of best poses whose near-symmetries and whose neighbours are added, and number of these variants kept.
SYMMETRY_PARENTS = 3
NEIGHBOUR_PARENTS = 4
VARIANT_POSES = 18


def refine_by_edges(
    target: PreparedTarget, frame: Observation, edges: RegionEdges, q: Array, t: Array
) -> List[Hypothesis]:
    """Align the poses proposed for one region on its edges, and return the best distinct ones as hypotheses.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise; receives the times of the stages.
    edges : RegionEdges
        Edges of the region at two scales.
    q : (N, 4) array
        Proposed attitudes, camera from target.
    t : (N, 3) array
        Proposed positions of the target, camera frame [m].

    Returns
    -------
    list of Hypothesis
        Aligned hypotheses with their edge support, best first.
    """
    if not len(q):
        return []
    views, coarse, fine = edges.views, edges.coarse, edges.fine
    q, t = align_to_field(target, q, t, views, coarse, FIRST_COARSE_REACH_PX, COARSE_STRIDE)
    cost = quick_cost(target, q, t, views, coarse, FIRST_CAP_PX, COARSE_STRIDE)
    q, t = distinct(q, t, cost, FIRST_COARSE_POSES)
    q, t = align_to_field(target, q, t, views, coarse, SECOND_COARSE_REACH_PX, COARSE_STRIDE)
    q, t = distinct(q, t, quick_cost(target, q, t, views, coarse, CAP_PX), SECOND_COARSE_POSES)
    q, t = align_to_field(target, q, t, views, fine, FINE_REACH_PX)
    keep = FINE_POSES_WITHOUT_FACES if target.model.faces is None else FINE_POSES
    q, t = distinct(q, t, quick_cost(target, q, t, views, fine, CAP_PX), keep)
    frame.mark("edge_alignment")
    hypotheses = _with_support(target, q, t, edges)
    frame.mark("edge_support")
    if target.model.faces is None:
        # with faces, near-symmetries are compared later, on the whole image
        variants = near_symmetries(target, hypotheses[:SYMMETRY_PARENTS])
        variants += neighbours(target, hypotheses[:NEIGHBOUR_PARENTS])
        if variants:
            q, t = np.array([h.q for h in variants]), np.array([h.t for h in variants])
            q, t = align_to_field(target, q, t, views, fine, VARIANT_REACH_PX)
            q, t = distinct(q, t, quick_cost(target, q, t, views, fine, CAP_PX), VARIANT_POSES)
            hypotheses += _with_support(target, q, t, edges)
            hypotheses.sort(key=lambda h: -h.support.total)
        frame.mark("edge_alignment")
    frame.count("candidates", len(hypotheses))
    return hypotheses


def distinct(q: Array, t: Array, cost: Array, keep: int) -> Tuple[Array, Array]:
    """Return at most ``keep`` poses, by increasing cost, without near-duplicates of a better one.

    Parameters
    ----------
    q : (N, 4) array
        Attitudes, camera from target.
    t : (N, 3) array
        Positions of the target, camera frame [m].
    cost : (N,) array
        Cost of each pose; poses whose cost is not finite are dropped.
    keep : int
        Maximum number of poses returned.
    """
    indices: List[int] = []
    for i in np.argsort(cost):
        if not np.isfinite(cost[i]):
            continue
        if indices:
            duplicate = quat.angle_rad(q[indices], q[i]) < DUPLICATE_RAD
            duplicate &= np.linalg.norm(t[indices] - t[i], axis=1) < DUPLICATE_SHARE * abs(t[i, 2])
            if duplicate.any():
                continue
        indices.append(int(i))
        if len(indices) >= keep:
            break
    return q[indices], t[indices]


def _with_support(target: PreparedTarget, q: Array, t: Array, edges: RegionEdges) -> List[Hypothesis]:
    """Return hypotheses with their support by the fine edges, best first."""
    source = Source(edges.region, edges.fine)
    hypotheses = []
    for k in range(len(q)):
        edge_support = support(target, q[k], t[k], edges.fine)
        hypotheses.append(Hypothesis(PoseFit(q[k], t[k]), source, edge_support.total, edge_support))
    hypotheses.sort(key=lambda h: -h.score)
    return hypotheses
