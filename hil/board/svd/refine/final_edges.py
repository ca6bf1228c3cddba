"""The last stage: the leaders refined to sub-pixel on all visible edges, and the best of them chosen."""

from __future__ import annotations

from typing import Dict, List, Tuple

import numpy as np

from hil.board.svd.decide.confidence import Evidence
from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.hypotheses.ambiguity import Alternative, alternatives, differs, largest_sigma
from hil.board.svd.hypotheses.edge_support import support
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.edge_field import gradient, gradient_noise, shrink
from hil.board.svd.image.observation import Observation
from hil.board.svd.image.region import Region
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.visibility import visible_samples
from hil.board.svd.propose.edge_search import MARGIN, neighbours, twins
from hil.board.svd.refine.edges import FineFit, Gradients, fine_align

Array = np.ndarray
Judged = Tuple[Candidate, FineFit]

# Leaders refined, and how far behind the first they may be in total support.
LEADERS, LEAD = 6, 0.1

# What a sharp sub-pixel fit weighs against the total support among near poses.
TIGHT_WEIGHT = 0.5

# Longest side of the region for the sub-pixel search [px].
LONGEST_PX = 800


def choose(
    craft: PreparedTarget, frame: Observation, found: List[Candidate]
) -> Tuple[Candidate, FineFit, Evidence, Tuple[Alternative, ...]]:
    """Refine the leaders, pick the best, and gather the evidence for it and its distinct rivals.

    Parameters
    ----------
    found : candidates of every region, best first, at least one.
    """
    gradients: Dict[Region, Gradients] = {}
    lead = found[0].support.total - LEAD
    leaders = [c for c in found[:LEADERS] if c.support.total >= lead]
    judged = [_polish(craft, frame, c, gradients) for c in leaders]
    frame.mark("refine")
    # once more around the winner: pairs of parallel edges make many near minima
    c = max(judged, key=_total)[0]
    q, t = neighbours(craft, [c], 0.4)
    starts = [Candidate(q[k], t[k], c.support, c.field, c.region) for k in range(len(q))]
    judged += [_polish(craft, frame, s, gradients) for s in starts]
    # and its twins at the same precision: the rival must have had every chance
    c = max(judged, key=_total)[0]
    q, t = twins(craft, [c])
    starts = [Candidate(q[k], t[k], c.support, c.field, c.region) for k in range(len(q))]
    judged += [_polish(craft, frame, s, gradients) for s in starts]
    # distinct poses are told apart by the whole support, near ones by how sharply they fit
    top = max(judged, key=_total)[0]
    near = [j for j in judged if not differs(j[0].q, j[0].t, top.q, top.t)]
    best, fit = max(near, key=lambda j: _total(j) + TIGHT_WEIGHT * j[1].tight)
    rivals = [r.support.total for r in found if differs(r.q, r.t, fit.q, fit.t)]
    rivals += [_total(j) for j in judged if differs(j[0].q, j[0].t, fit.q, fit.t)]
    frame.mark("verify")
    # what the best pose of this neighbourhood scores against the best of any other
    margin = top.support.total - max(rivals, default=0.0)
    rival_poses = [(r.q, r.t, r.support.total) for r in (*found, *(j[0] for j in judged))]
    return best, fit, _evidence(craft, best, fit, margin), alternatives(rival_poses, fit.q, fit.t)


def _total(judged: Judged) -> float:
    return judged[0].support.total


def _evidence(craft: PreparedTarget, best: Candidate, fit: FineFit, margin: float) -> Evidence:
    turn = largest_sigma(fit.covariance[:3, :3])
    shift = largest_sigma(fit.covariance[3:, 3:])
    return Evidence(
        drawn=best.support.drawn,
        explained=best.support.explained,
        outside=best.support.outside,
        margin=margin,
        found=fit.found,
        tight=fit.tight,
        rms_px=fit.rms_px,
        sigma_rad=turn,
        sigma_share=shift / float(np.linalg.norm(fit.t)),
        edges=int(fit.found * len(best.support.visible)),
        size_px=2 * craft.radius_m * craft.camera.fx_px / max(float(fit.t[2]), 1e-3),
        empty=best.field.empty,
    )


def _polish(
    craft: PreparedTarget, frame: Observation, start: Candidate, gradients: Dict[Region, Gradients]
) -> Judged:
    if start.region not in gradients:
        gradients[start.region] = region_gradients(frame, start.region, empty=start.field.empty)
    g = gradients[start.region]
    q, t, fit = start.q, start.t, None
    for reach in ((8, 6, 5), (4, 4, 3, 3)):
        R = quat.matrix(q)
        visible = np.flatnonzero(visible_samples(craft.samples, craft.occ, -R.T @ t)[0])
        if len(visible) < 8 and fit is not None:
            break
        fit = fine_align(q, t, craft.samples, visible, g, craft.occ, craft.camera, craft.radius_m, reach)
        q, t = fit.q, fit.t
    assert fit is not None  # noqa: S101 - the first pass always runs
    s = support(q, t, craft.samples, craft.occ, start.field, craft.camera, craft.spacing_m)
    return Candidate(q, t, s, start.field, start.region), fit


def region_gradients(frame: Observation, region: Region, *, empty: bool) -> Gradients:
    """Gradient of a region for the sub-pixel search."""
    h, w = frame.image.shape
    x0, y0, x1, y1 = region.grown(MARGIN, w, h)
    small, factor = shrink(frame.image, x0, y0, x1, y1, LONGEST_PX)
    blur = 1.0 if factor > 1.5 else 1.5
    gx, gy = gradient(small, blur)
    return Gradients(gx, gy, frame.noise / factor * gradient_noise(blur), x0, y0, factor, empty)
