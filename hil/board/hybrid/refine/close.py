"""Close alignment: the best hypotheses, and near-symmetries of the best one, scored on one patch.

Values without a source are hand-tuned on development frames (docs/lab/2026-11-estimator.md).
"""

from __future__ import annotations

from typing import List, Optional, Tuple

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
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.variants import align_centroids, near_symmetries
from flyaround.hil.board.hybrid.refine.parallel import Pruning, draw, draw_shadows, refine_in_parallel

# Maximum number of hypotheses that are compared with the best one.
MAX_RIVALS = 3

# Minimum share of the best score at which a near-symmetry is aligned.
SYMMETRY_SHARE = 0.6

# Longest side of the patch [px], and blur and pruning of each step (see ``coarse.COARSE_PRUNINGS``).
CLOSE_PX, CLOSE_BLURS = 120, (1.2, 0.6)
CLOSE_PRUNINGS = (Pruning(0.65, 0.07), Pruning(0.85, 0.07))


def refine_close_up(
    target: PreparedTarget, frame: Observation, leaders: List[Hypothesis], prior: Optional[Prior]
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
    """
    first = leaders[0].at(leaders[0].q, leaders[0].t)
    others = [h.at(h.q, h.t) for h in without_duplicates(leaders) if h is not leaders[0]]
    others = [o for o in others if o.source.region == first.source.region][:MAX_RIVALS]
    patch = cut_patch(target, frame, target_box(target, first.q, first.t), CLOSE_PX)
    drawn = [draw(target, patch, h) for h in (first, *others)]
    # a near-symmetry that is already among the hypotheses is not aligned twice
    twins = [
        draw(target, patch, twin)
        for twin in align_centroids(target, patch, _likely_symmetries(target, first, prior), first)
        if all(quat.angle_rad(twin.q, o.q) > SPREAD_RAD for o in (first, *others))
    ]
    # in front of a texture an error of a few degrees costs most of the score: every near-symmetry is aligned
    textured = frame.background < 0
    drawn += [twin for twin in twins if textured or twin.score > SYMMETRY_SHARE * drawn[0].score]
    drawn = [draw_shadows(target, patch, h) for h in drawn]
    ranked = refine_in_parallel(target, patch, drawn, CLOSE_BLURS, CLOSE_PRUNINGS)
    frame.count("judged", len(ranked))
    return patch, ranked


def _likely_symmetries(target: PreparedTarget, pose: Hypothesis, prior: Optional[Prior]) -> List[Hypothesis]:
    """Return near-symmetries of a pose, except those that the network considers far less likely than the pose."""
    return [h for h in without_unlikely([pose, *near_symmetries(target, [pose])], prior) if h is not pose]
