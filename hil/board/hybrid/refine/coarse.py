"""Coarse alignment: the most likely hypotheses of each region in parallel, on a small patch of it."""

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

# Most hypotheses of a region that are scored before empty space, before a texture and in a second round, and most that
# are refined.
EMPTY_SCORED, TEXTURED_SCORED, THOROUGH_SCORED, LEADERS = 8, 16, 32, 4

# Most that are refined in the light of lamps, where the network is less certain and the model less accurate.
LAMPS_LEADERS = 7

# Most hypotheses of a region that are drawn with shadows, and most that are scored of those proposed by edges.
SHADOWED, EDGES_SCORED = 8, 8

# Weight of the network's log-likelihood against the score.
PRIOR_WEIGHT = 0.01

# Longest side of the patch [px], and the blur of each step.
COARSE_PX, COARSE_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# Before a texture clutter outweighs the few pixels of the target.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)

# Pruning of each step: least share of the best score, and least angle to a better pose [rad] (128 development frames).
COARSE_PRUNINGS = (Pruning(-9.0, 0.0), Pruning(0.75, 0.05), Pruning(0.8, 0.1), Pruning(0.85, 0.1))

# Margin around a place of the network, which encloses the target.
NETWORK_MARGIN = 0.1


def refine_coarsely(
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    found: List[Hypothesis],
    *,
    thorough: bool = False,
) -> List[Hypothesis]:
    """Align the best hypotheses of each region on a small patch of it, and return them, the best first.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    regime : Regime
        Its light.
    found : list of Hypothesis
        Hypotheses of every region, the best first.
    thorough : bool
        Score more of them, with their shadows.
    """
    refined: List[Hypothesis] = []
    # scores of different regions are not comparable: each keeps its own best
    for region in dict.fromkeys(h.source.region for h in found):
        learned = region.source == "learned"
        own = [h for h in found if h.source.region == region]
        margin = NETWORK_MARGIN if learned else MARGIN
        height, width = frame.image.shape
        textured = learned and frame.background < 0
        lamps = learned and regime is Regime.LAMPS
        first = TEXTURED_SCORED if textured or lamps else EMPTY_SCORED
        own = own[: EDGES_SCORED if not learned else THOROUGH_SCORED if thorough else first]
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (COARSE_PX, COARSE_BLURS)
        box = pinhole_box(target.camera, region.grown(margin, width, height))
        patch = cut_patch(target, frame, box, longest)
        # a second round begins with hypotheses of the first: these are not drawn again
        drawings = frame.drawn.pop((box, longest), {}) if learned else None
        if drawings is not None and not thorough:
            # a second round is the last: only drawings of the first are kept
            frame.drawn[box, longest] = drawings
        drawn = sorted((draw(target, patch, h, drawings) for h in own), key=_with_prior)
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
    """Sorting key: score plus the network's weighted log-likelihood, the best first."""
    return -h.score - PRIOR_WEIGHT * h.source.log_prior
