"""Check of near minima: a doubtful selection against poses tilted from it."""

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

# Blur of each step of the tilts [px], its pruning, and least angle between two distinct poses [rad].
CHECK_BLURS, CHECK_PRUNINGS = (
    (2.0, 2.0, 1.2, 0.6),
    (Pruning(-9.0, 0.0), Pruning(-9.0, 0.03), Pruning(0.5, 0.05), Pruning(0.6, 0.07)),
)
CHECK_RAD = float(np.radians(3.0))

# Least angle in the light of lamps [rad], and tilts there [rad]: a mock-up that differs from its model has more minima,
# and nearer ones.
LAMPS_RAD, LAMPS_LEAN_RAD = float(np.radians(1.5)), float(np.radians(5.0))

# Rounds of refinement there; no pruning, for scores jump; most tilts that are refined, and their least share of the
# score.
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
    """Compare a selection with poses tilted from it to every side, the best of them refined, and return the better one.

    A nearly flat target has local minima of its tilt, 5 to 17 deg apart. Edges and likeness agree with each of them;
    the right one explains more of the image.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    regime : Regime
        Its light.
    selection : Selection
        The selection to check.
    symmetries : bool
        Compare with near-symmetries as well. False after ``check_discrete_symmetry``, whose finer evidence the score of
        this coarse image would overrule.
    """
    end, patch = selection.best, selection.close
    if regime is Regime.LAMPS:
        return _check_near_by(target, frame, selection)
    ranked = refine_tilts(target, patch, end, CHECK_BLURS, CHECK_PRUNINGS)
    ranked += refine_symmetries(target, patch, end, listed=symmetries)
    ranked.sort(key=lambda h: -h.score)
    frame.count("judged", len(ranked))
    best = ranked[0]
    # a tilt that returned to the selected pose adds nothing, and one that has not converged is no rival
    if quat.angle_rad(best.q, end.q) <= CHECK_RAD or best.score <= FINAL_LEAD * end.score:
        return selection
    ends = [*selection.ends, refine_to_end(target, frame, patch, best)]
    return select(target, patch, list(selection.ranked), ends)


def _check_near_by(target: PreparedTarget, frame: Observation, selection: Selection) -> Selection:
    """Return the better selection in the light of lamps."""
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
