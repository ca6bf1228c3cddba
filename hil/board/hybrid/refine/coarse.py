"""Coarse alignment: the most likely hypotheses of each region, refined in parallel on a small patch.

Values without a source are hand-tuned on development frames (docs/lab/2026-11-estimator.md).
"""

from __future__ import annotations

from typing import List

import numpy as np

from flyaround.hil.board.hybrid.hypotheses.ambiguity import spread_in_attitude
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, pinhole_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.edge_search import MARGIN
from flyaround.hil.board.hybrid.refine.parallel import Pruning, draw, draw_shadows, refine_in_parallel

# Maximum number of hypotheses of a region that are scored, and that are refined. Leaders differ in attitude by at least
# an angle [rad] within which they converge to the same pose (docs/lab/2026-11-keypoint-network.md).
SCORED, LEADERS, LEADER_SPREAD_RAD = 8, 4, float(np.radians(20.0))

# Weight of the network's log-likelihood relative to the score.
PRIOR_WEIGHT = 0.01

# Longest side of the patch [px], and blur of each step.
COARSE_PX, COARSE_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# In front of a texture, clutter outweighs the few pixels of the target.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)

# Pruning of each step: minimum share of the best score, minimum angle to a better pose [rad] (development frames).
COARSE_PRUNINGS = (Pruning(-9.0, 0.0), Pruning(0.75, 0.05), Pruning(0.8, 0.1), Pruning(0.85, 0.1))

# Margin around a location from the network, whose box encloses the target.
NETWORK_MARGIN = 0.1


def refine_coarsely(
    target: PreparedTarget, frame: Observation, proposed: List[Hypothesis]
) -> List[Hypothesis]:
    """Align the best hypotheses of each region on a small patch of it, and return them, best first.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    proposed : list of Hypothesis
        Hypotheses of every region, best first.
    """
    refined: List[Hypothesis] = []
    height, width = frame.image.shape
    # scores of different regions are not comparable, so each region keeps its own best
    for region in dict.fromkeys(h.source.region for h in proposed):
        learned = region.source == "learned"
        textured = learned and frame.background < 0
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (COARSE_PX, COARSE_BLURS)
        box = pinhole_box(target.camera, region.grown(NETWORK_MARGIN if learned else MARGIN, width, height))
        patch = cut_patch(target, frame, box, longest)
        candidates = [h for h in proposed if h.source.region == region][:SCORED]
        drawn = sorted((draw(target, patch, h) for h in candidates), key=_with_prior)
        leaders = spread_in_attitude(drawn, LEADERS, LEADER_SPREAD_RAD)
        shadowed = [draw_shadows(target, patch, h) for h in leaders]
        refined += refine_in_parallel(target, patch, shadowed, blurs, COARSE_PRUNINGS)
    frame.count("judged", len(refined))
    return sorted(refined, key=lambda h: -h.score)


def _with_prior(h: Hypothesis) -> float:
    """Return the sorting key: score plus the network's weighted log-likelihood, negated."""
    return -h.score - PRIOR_WEIGHT * h.source.log_prior
