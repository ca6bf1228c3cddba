"""Coarse alignment: hypotheses of each region on a small patch of it, the likeliest in parallel."""

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

# Hypotheses of a region looked at at first and where those did not settle it, and those refined of them. Before empty
# space eight of a learned proposal's sixteen led as far as all; before the Earth three of 266 development frames were
# lost.
ASKED, TEXTURED_ASKED, ALL_ASKED, LEADERS = 8, 16, 32, 4

# Those refined in the light of lamps, where the proposal is less sure and the model less right.
LAMPS_LEADERS = 7

# So many of a region are drawn with shadows, of those that its own edges propose so many at all.
LIT, LIT_OF_EDGES = 8, 8

# What a unit of the learned proposal's log-likelihood counts against the score.
PRIOR_WEIGHT = 0.01

# Longest side of the patch [px], and the blur of each step.
COARSE_PX, COARSE_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# Against a texture clutter outweighs what few pixels of the target can say.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)

# Who goes on with each step: share of the best score, and least distance from a better one [rad]. On 128 development
# frames the pose that won was best after one step far off, or had 0.93 of it; at once close up 0.88. Of poses within
# these angles the better one ended as near to the truth as the others.
COARSE_PRUNINGS = (Pruning(-9.0, 0.0), Pruning(0.75, 0.05), Pruning(0.8, 0.1), Pruning(0.85, 0.1))

# Margin round a place of the learned proposal, which holds all of the target.
PLACE_MARGIN = 0.1


def refine_coarsely(
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    found: List[Hypothesis],
    *,
    thorough: bool = False,
) -> List[Hypothesis]:
    """The hypotheses of each region that look best, aligned on a small patch of it; the best first.

    Parameters
    ----------
    found : hypotheses of every region, best first.
    thorough : draw them with the shadows that the image wants; of a region's own edges few are looked at then.
    """
    refined: List[Hypothesis] = []
    # edges of one region say nothing of another's: each sends its own leaders
    for region in dict.fromkeys(h.source.region for h in found):
        learned = region.source == "learned"
        own = [h for h in found if h.source.region == region]
        margin = PLACE_MARGIN if learned else MARGIN
        height, width = frame.image.shape
        textured = learned and frame.background < 0
        lamps = learned and regime is Regime.LAMPS
        first = TEXTURED_ASKED if textured or lamps else ASKED
        own = own[: LIT_OF_EDGES if not learned else ALL_ASKED if thorough else first]
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (COARSE_PX, COARSE_BLURS)
        box = pinhole_box(target.camera, region.grown(margin, width, height))
        patch = cut_patch(target, frame, box, longest)
        # a second round begins with hypotheses of the first: these are not drawn again
        drawings = frame.drawn.pop((box, longest), {}) if learned else None
        if drawings is not None and not thorough:
            # nobody comes back a third time: what the second leaves would only fill memory
            frame.drawn[box, longest] = drawings
        some = sorted((draw(target, patch, h, drawings) for h in own), key=_with_prior)
        if thorough:
            some = sorted((draw_shadows(target, patch, h, drawings) for h in some[:LIT]), key=_with_prior)
        some = spread_in_attitude(some, LAMPS_LEADERS if lamps else LEADERS)
        if not thorough:
            some = [draw_shadows(target, patch, h, drawings) for h in some]
        refined += refine_in_parallel(target, patch, some, blurs, COARSE_PRUNINGS, drawings)
    frame.count("judged", len(refined))
    return sorted(refined, key=lambda h: -h.score)


def _with_prior(h: Hypothesis) -> float:
    """Sorting key: the best score first, with a little of what the learned proposal thinks of it."""
    return -h.score - PRIOR_WEIGHT * h.source.log_prior
