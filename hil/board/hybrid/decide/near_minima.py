"""Check of near minima: a doubtful selection against the tilts of its pose."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.decide.selection import FINAL_LEAD, Selection, select
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.close import refine_symmetries, refine_tilts
from flyaround.hil.board.hybrid.refine.final import refine_to_end
from flyaround.hil.board.hybrid.refine.parallel import Pruning

# Blur of each step of the tilts, who goes on with it, and how far from the end another pose must be [rad].
CHECK_BLURS, CHECK_PRUNINGS = (
    (2.0, 2.0, 1.2, 0.6),
    (Pruning(-9.0, 0.0), Pruning(-9.0, 0.03), Pruning(0.5, 0.05), Pruning(0.6, 0.07)),
)
CHECK_RAD = float(np.radians(3.0))

# The same in the light of lamps, and how far these lean: a craft that is not quite the model has more minima, and
# nearer ones. Of ten pictures of a mock-up two stood 6 deg off where 5 deg on the score was a fifth higher.
LAMPS_RAD, LAMPS_LEAN_RAD = float(np.radians(1.5)), float(np.radians(5.0))

# None of these is dropped on its way, for scores jump; so many of them are refined to their ends, with this share of
# its score.
LAMPS_ROUNDS = 2
LAMPS_BLURS, LAMPS_PRUNINGS, LAMPS_ENDS, LAMPS_LEAD = (1.2, 0.6), (Pruning(-9.0, 0.0),) * 2, 2, 0.7


def check_near_minima(
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    selection: Selection,
    *,
    symmetries: bool = True,
) -> Selection:
    """A selection again beside poses tilted to every side of its end, the best of them refined to its end.

    What is nearly flat has near minima of its tilt, 5 to 17 deg apart, and edges and likeness agree with each: on 300
    development frames four of six wrong poses that were accepted lay in one, and the right one explained more.

    Parameters
    ----------
    symmetries : ask its near-symmetries as well. Not where ``check_discrete_symmetry`` has judged them by more than
        this score, which is a coarse image's and would bring back what that has refused.
    """
    end, patch = selection.best, selection.close
    if regime is Regime.LAMPS:
        return _check_near_by(target, frame, selection)
    ranked = refine_tilts(target, patch, end, CHECK_BLURS, CHECK_PRUNINGS)
    ranked += refine_symmetries(target, patch, end, listed=symmetries)
    ranked.sort(key=lambda h: -h.score)
    frame.count("judged", len(ranked))
    best = ranked[0]
    # what came back to where it leant from says nothing new, and what is on its way is no rival: of 250 poses that
    # these made look doubtful 19 were declined, all of them right
    if quat.angle_rad(best.q, end.q) <= CHECK_RAD or best.score <= FINAL_LEAD * end.score:
        return selection
    ends = [*selection.ends, refine_to_end(target, frame, patch, best)]
    return select(target, patch, list(selection.ranked), ends)


def _check_near_by(target: PreparedTarget, frame: Observation, selection: Selection) -> Selection:
    """The same in the light of lamps."""
    end, patch = selection.best, selection.close
    ranked = refine_tilts(target, patch, end, LAMPS_BLURS, LAMPS_PRUNINGS, LAMPS_LEAN_RAD)
    frame.count("judged", len(ranked))
    ends = list(selection.ends)
    for h in ranked:
        if len(ends) == len(selection.ends) + LAMPS_ENDS or h.score <= LAMPS_LEAD * end.score:
            break
        if all(quat.angle_rad(h.q, e.q) > LAMPS_RAD for e in ends):
            ends.append(refine_to_end(target, frame, patch, h, LAMPS_ROUNDS))
    if len(ends) == len(selection.ends):
        return selection
    return select(target, patch, list(selection.ranked), ends)
