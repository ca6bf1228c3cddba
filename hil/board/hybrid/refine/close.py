"""Close alignment: the best hypotheses, and near-symmetries and tilts of the best one, scored on one patch.

Values without a source are hand-tuned on development frames (docs/lab/2026-11-estimator.md).
"""

from __future__ import annotations

from typing import List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import (
    SPREAD_RAD,
    Prior,
    without_duplicates,
    without_unlikely,
)
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import Box, cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.variants import align_centroids, near_symmetries, tilts
from flyaround.hil.board.hybrid.refine.parallel import Pruning, draw, draw_shadows, refine_in_parallel

# Maximum number of hypotheses that are compared with the best one, in the first and in the second round.
MAX_RIVALS, THOROUGH_RIVALS = 3, 7

# Minimum share of the best score at which a near-symmetry is aligned, and minimum overlap of boxes at one location.
SYMMETRY_SHARE, MIN_OVERLAP = 0.6, 0.5

# Longest side of the patch [px], and blur and pruning of each step (see ``coarse.COARSE_PRUNINGS``).
CLOSE_PX, CLOSE_BLURS = 120, (1.2, 0.6)
CLOSE_PRUNINGS = (Pruning(0.65, 0.07), Pruning(0.85, 0.07))

# Blurs and prunings for tilts, which start far from their optima.
TILT_BLURS = (2.0, 2.0, 2.0, 1.2, 0.6)
TILT_PRUNINGS = (Pruning(-9.0, 0.0), Pruning(-9.0, 0.03), Pruning(-9.0, 0.05), *CLOSE_PRUNINGS)


def refine_close_up(
    target: PreparedTarget,
    frame: Observation,
    leaders: List[Hypothesis],
    prior: Optional[Prior] = None,
    *,
    thorough: bool = False,
) -> Tuple[ImagePatch, List[Hypothesis]]:
    """Return the patch around the best hypothesis, and hypotheses and near-symmetries aligned on it, best first.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    leaders : list of Hypothesis
        Hypotheses from ``refine_coarsely``, best first, at least one.
    prior : callable, optional
        Log-likelihood of a pose by the network.
    thorough : bool
        Align more hypotheses, every near-symmetry and tilts of the best one, all with shadows, because the first round
        may have ended in a local optimum.
    """
    first = leaders[0].at(leaders[0].q, leaders[0].t)
    box = target_box(target, first.q, first.t)
    others = [h.at(h.q, h.t) for h in without_duplicates(leaders) if h is not leaders[0]]
    if thorough:
        others = [o for o in others if _overlap(box, target_box(target, o.q, o.t)) > MIN_OVERLAP][
            :THOROUGH_RIVALS
        ]
        boxes = np.array([box, *(target_box(target, o.q, o.t) for o in others)])
        (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        box = int(x0), int(y0), int(x1), int(y1)
    else:
        others = [o for o in others if o.source.region == first.source.region][:MAX_RIVALS]
    patch = cut_patch(target, frame, box, CLOSE_PX)
    drawn = [draw(target, patch, h) for h in (first, *others)]
    # a near-symmetry that is already among the hypotheses is not aligned twice
    twins = [
        draw(target, patch, twin)
        for twin in align_centroids(target, patch, _likely_symmetries(target, first, prior), first)
        if all(quat.angle_rad(twin.q, o.q) > SPREAD_RAD for o in (first, *others))
    ]
    # in front of a texture an error of a few degrees costs most of the score: every near-symmetry is aligned
    align_all = thorough or frame.background < 0
    drawn += [twin for twin in twins if align_all or twin.score > SYMMETRY_SHARE * drawn[0].score]
    drawn = [draw_shadows(target, patch, h) for h in drawn]
    ranked = refine_in_parallel(target, patch, drawn, CLOSE_BLURS, CLOSE_PRUNINGS)
    n_aligned = len(ranked)
    if thorough:
        ranked += refine_tilts(target, patch, ranked[0], TILT_BLURS, TILT_PRUNINGS)
        ranked.sort(key=lambda h: -h.score)
        ranked += refine_symmetries(target, patch, ranked[0], prior)
        n_aligned = len(ranked)
        ranked = without_duplicates(sorted(ranked, key=lambda h: -h.score))
    frame.count("judged", n_aligned)
    return patch, ranked


def refine_tilts(
    target: PreparedTarget,
    patch: ImagePatch,
    pose: Hypothesis,
    blurs: Tuple[float, ...],
    prunings: Tuple[Pruning, ...],
) -> List[Hypothesis]:
    """Return tilts of a pose, aligned with shadows, best first."""
    tilted = [draw_shadows(target, patch, draw(target, patch, h)) for h in tilts(target, pose)]
    return refine_in_parallel(target, patch, tilted, blurs, prunings)


def refine_symmetries(
    target: PreparedTarget, patch: ImagePatch, pose: Hypothesis, prior: Optional[Prior]
) -> List[Hypothesis]:
    """Return near-symmetries of a nearly converged pose, aligned with shadows, best first.

    Near-symmetries of a pose that has not converged are a few degrees off, which in front of a texture costs most of
    the score.
    """
    variants = align_centroids(target, patch, _likely_symmetries(target, pose, prior), pose)
    drawn = [draw_shadows(target, patch, draw(target, patch, h)) for h in variants]
    return refine_in_parallel(target, patch, drawn, CLOSE_BLURS, CLOSE_PRUNINGS)


def _likely_symmetries(target: PreparedTarget, pose: Hypothesis, prior: Optional[Prior]) -> List[Hypothesis]:
    """Return near-symmetries of a pose, except those that the network considers far less likely than the pose."""
    return [h for h in without_unlikely([pose, *near_symmetries(target, [pose])], prior) if h is not pose]


def _overlap(a: Box, b: Box) -> float:
    """Return the intersection area of two boxes divided by the area of the smaller one."""
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    smaller_area = min((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in (a, b))
    return max(width, 0) * max(height, 0) / max(smaller_area, 1)
