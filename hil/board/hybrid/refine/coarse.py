"""Coarse alignment: the most likely hypotheses of each region, refined in parallel on a small patch.

Values without a source are hand-tuned on development frames (docs/lab/2026-11-estimator.md).
"""

from __future__ import annotations

from typing import List

from flyaround.hil.board.hybrid.hypotheses.ambiguity import spread_in_attitude
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, pinhole_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.edge_search import MARGIN
from flyaround.hil.board.hybrid.refine.parallel import Pruning, draw, draw_shadows, refine_in_parallel

# Maximum number of hypotheses of a region that are scored in front of empty space, in front of a texture and in a
# second round, and maximum number that are refined.
EMPTY_SCORED, TEXTURED_SCORED, THOROUGH_SCORED, LEADERS = 8, 16, 32, 4

# Maximum number refined under lamps, where the network is less certain and the model less accurate.
LAMPS_LEADERS = 7

# Maximum number of hypotheses of a region rendered with shadows, and scored of those proposed by edges.
SHADOWED, EDGES_SCORED = 8, 8

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
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    proposed: List[Hypothesis],
    *,
    thorough: bool = False,
) -> List[Hypothesis]:
    """Align the best hypotheses of each region on a small patch of it, and return them, best first.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    regime : Regime
        Illumination regime of the image.
    proposed : list of Hypothesis
        Hypotheses of every region, best first.
    thorough : bool
        Score more hypotheses, with shadows.
    """
    refined: List[Hypothesis] = []
    # scores of different regions are not comparable, so each region keeps its own best
    for region in dict.fromkeys(h.source.region for h in proposed):
        learned = region.source == "learned"
        candidates = [h for h in proposed if h.source.region == region]
        margin = NETWORK_MARGIN if learned else MARGIN
        height, width = frame.image.shape
        textured = learned and frame.background < 0
        lamps = learned and regime is Regime.LAMPS
        n_scored = TEXTURED_SCORED if textured or lamps else EMPTY_SCORED
        candidates = candidates[: EDGES_SCORED if not learned else THOROUGH_SCORED if thorough else n_scored]
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (COARSE_PX, COARSE_BLURS)
        box = pinhole_box(target.camera, region.grown(margin, width, height))
        patch = cut_patch(target, frame, box, longest)
        # a second round starts from hypotheses of the first, whose renderings are reused
        drawings = frame.drawn.pop((box, longest), {}) if learned else None
        if drawings is not None and not thorough:
            # the second round is the last, so only renderings of the first round are cached
            frame.drawn[box, longest] = drawings
        drawn = sorted((draw(target, patch, h, drawings) for h in candidates), key=_with_prior)
        if thorough:
            drawn = sorted(
                (draw_shadows(target, patch, h, drawings) for h in drawn[:SHADOWED]), key=_with_prior
            )
        drawn = spread_in_attitude(drawn, LAMPS_LEADERS if lamps else LEADERS)
        if not thorough:
            drawn = [draw_shadows(target, patch, h, drawings) for h in drawn]
        refined += refine_in_parallel(target, patch, drawn, blurs, COARSE_PRUNINGS, drawings)
    frame.count("judged", len(refined))
    return sorted(refined, key=lambda h: -h.score)


def _with_prior(h: Hypothesis) -> float:
    """Return the sorting key: score plus the network's weighted log-likelihood, negated."""
    return -h.score - PRIOR_WEIGHT * h.source.log_prior
