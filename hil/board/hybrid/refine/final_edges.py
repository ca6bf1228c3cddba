"""Final alignment on sub-pixel edges, for targets without faces and for the published methods."""

from __future__ import annotations

from typing import Dict, List

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.edge_field import gradient, gradient_noise, shrink
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.visibility import visible_samples
from flyaround.hil.board.hybrid.propose.edge_search import MARGIN
from flyaround.hil.board.hybrid.propose.variants import near_symmetries, neighbours
from flyaround.hil.board.hybrid.refine.edges import Gradients, fine_align
from flyaround.hil.board.svd.region_of_interest import Region

# Maximum number of refined hypotheses, and their maximum deficit of total support; hand-tuned, as are the values below.
MAX_REFINED, MAX_DEFICIT = 6, 0.1

# Distance of the best pose's neighbours as a share of the steps of ``variants.NEIGHBOURS``.
NEIGHBOUR_SHARE = 0.4

# Longest side of the region for the sub-pixel search [px], and reach of each step [px].
LONGEST_PX, REACHES = 800, ((8, 6, 5), (4, 4, 3, 3))


def refine_on_edges(
    target: PreparedTarget, frame: Observation, proposed: List[Hypothesis]
) -> List[Hypothesis]:
    """Refine the best hypotheses on sub-pixel edges, then neighbours and near-symmetries of the best one.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    proposed : list of Hypothesis
        Hypotheses of every region, best first, at least one.
    """
    gradients: Dict[Region, Gradients] = {}
    refined = [
        _refine(target, frame, h, gradients)
        for h in proposed[:MAX_REFINED]
        if h.score >= proposed[0].score - MAX_DEFICIT
    ]
    # pairs of parallel edges cause many close optima around the best pose
    variants = neighbours(target, [max(refined, key=_score)], NEIGHBOUR_SHARE)
    refined += [_refine(target, frame, h, gradients) for h in variants]
    # near-symmetries are refined to the same precision, for a fair comparison
    variants = near_symmetries(target, [max(refined, key=_score)])
    refined += [_refine(target, frame, h, gradients) for h in variants]
    return refined


def _score(h: Hypothesis) -> float:
    return h.score


def _refine(
    target: PreparedTarget, frame: Observation, start: Hypothesis, gradients: Dict[Region, Gradients]
) -> Hypothesis:
    """Return a hypothesis refined on the sub-pixel edges of its region."""
    region, field = start.source.region, start.source.field
    if region not in gradients:
        gradients[region] = region_gradients(frame, region, empty=field.empty)
    pose, fit = start.pose, None
    for reach in REACHES:
        R = quat.matrix(pose.q)
        visible = np.flatnonzero(visible_samples(target.samples, target.occ, -R.T @ pose.t)[0])
        if len(visible) < 8 and fit is not None:
            break
        pose, fit = fine_align(target, pose.q, pose.t, visible, gradients[region], reach)
    s = support(target, pose.q, pose.t, field)
    return Hypothesis(pose, start.source, s.total, s, edge_fit=fit, start=start)


def region_gradients(frame: Observation, region: Region, *, empty: bool) -> Gradients:
    """Return the image gradient of a region for the sub-pixel search."""
    h, w = frame.image.shape
    x0, y0, x1, y1 = region.grown(MARGIN, w, h)
    small, factor = shrink(frame.image, x0, y0, x1, y1, LONGEST_PX)
    # reduction blurs by itself; chosen by eye
    blur = 1.0 if factor > 1.5 else 1.5
    gx, gy = gradient(small, blur)
    return Gradients(gx, gy, frame.noise / factor * gradient_noise(blur), x0, y0, factor, empty)
