"""Hypothesis selection: the best refined pose, its rivals, and the evidence for the decision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import Alternative, alternatives, differs
from flyaround.hil.board.hybrid.decide.confidence import Evidence, min_margin
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.hypotheses.ambiguity import (
    largest_sigma,
    same_end,
    was_refined,
    without_duplicates,
)
from flyaround.hil.board.hybrid.hypotheses.edge_support import Support, support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.final import MAX_ROUNDS, refine_to_end
from flyaround.hil.board.hybrid.refine.photometric import burnt_share, likeness, photo_draw
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# Most hypotheses that are refined, and their least share of the best score; the same in a second round.
MAX_ENDS, END_SHARE = 2, 0.85
THOROUGH_ENDS, THOROUGH_SHARE = 3, 0.75

# Rounds of refinement in the light of lamps.
LAMPS_ROUNDS = 3

# Most rivals that are refined as well because they seem to explain as much as the winner.
MAX_TIES = 2

# Score from which no other pose near the best one is refined.
CLEAR_SCORE = 0.27

# A rival behind by this share of the best score is not searched for a better Sun.
MAX_DEFICIT = 0.5

# Weight of a sharp sub-pixel fit against the total support, among near poses.
TIGHT_WEIGHT = 0.5


@dataclass(frozen=True, eq=False)
class Selection:
    """A selected hypothesis and its competitors.

    Parameters
    ----------
    best : Hypothesis
        The selected one, refined.
    evidence : Evidence
        Input of the decision on it.
    alternatives : tuple of Alternative
        Distinct other poses.
    patch : ImagePatch, optional
        Patch that all were scored on; None of a selection by edges.
    ranked : tuple of Hypothesis
        Every hypothesis that was aligned there, the best first.
    ends : tuple of Hypothesis
        Those that were refined.
    rival : Hypothesis, optional
        The best other hypothesis that was not refined.
    """

    best: Hypothesis
    evidence: Evidence
    alternatives: Tuple[Alternative, ...]
    patch: Optional[ImagePatch] = None
    ranked: Tuple[Hypothesis, ...] = ()
    ends: Tuple[Hypothesis, ...] = ()
    rival: Optional[Hypothesis] = None

    @property
    def close(self) -> ImagePatch:
        """Patch that poses were scored on, of a selection by the image."""
        assert self.patch is not None  # noqa: S101 - a selection by edges has no such checks
        return self.patch


def select_by_image(
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    patch: ImagePatch,
    ranked: List[Hypothesis],
    *,
    thorough: bool = False,
) -> Selection:
    """Refine the best hypotheses, and select among them.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    regime : Regime
        Its light.
    patch : ImagePatch
        Patch of the target, of ``refine_close_up``.
    ranked : list of Hypothesis
        Hypotheses aligned on it, the best first.
    thorough : bool
        Refine more of them.
    """
    # scores of poses that have not converged do not rank them: refinement decides
    ends: List[Hypothesis] = []
    rounds = LAMPS_ROUNDS if regime is Regime.LAMPS else MAX_ROUNDS
    most, lead = (THOROUGH_ENDS, THOROUGH_SHARE) if thorough else (MAX_ENDS, END_SHARE)
    for h in ranked[:most]:
        if h.score <= lead * ranked[0].score and h is not ranked[0]:
            continue
        # near poses converge to one: refine both only if a small gain decides about acceptance
        starts = [e.origin for e in ends]
        if ends and len(without_duplicates([*starts, h])) == len(ends) and ends[0].score > CLEAR_SCORE:
            continue
        ends.append(refine_to_end(target, frame, patch, h, rounds))
    selection = select(target, patch, ranked, ends, thorough=thorough)
    # a rival that has not converged may converge to the winner, or fall behind
    for _ in range(MAX_TIES):
        rival = selection.rival
        if rival is None or selection.evidence.margin >= min_margin(selection.evidence):
            break
        if was_refined(rival, ends):
            break
        ends.append(refine_to_end(target, frame, patch, rival))
        selection = select(target, patch, ranked, ends, thorough=thorough)
    return selection


def select(
    target: PreparedTarget,
    patch: ImagePatch,
    ranked: List[Hypothesis],
    ends: List[Hypothesis],
    *,
    thorough: bool = False,
) -> Selection:
    """Select the best refined hypothesis, and collect the evidence for the decision on it.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Patch that all were scored on.
    ranked : list of Hypothesis
        Every hypothesis that was aligned there, the best first.
    ends : list of Hypothesis
        Those that were refined, at least one.
    thorough : bool
        True if the hypotheses come from many places and from all round the winner.
    """
    best = max(ends, key=lambda e: _merit(target, patch, e))
    pose, field = best.pose, best.source.field
    s = support(target, pose.q, pose.t, field, alone=True)
    there = [e.origin for e in ends if same_end(e.pose, pose)]
    margin = here = max(start.score for start in there)
    rivals = [h for h in ranked if differs(h.q, h.t, pose.q, pose.t)]
    # a start that converged to the winner is no rival; but if the only start was far away, among few hypotheses, the
    # convergence may be accidental
    if thorough or not all(differs(start.q, start.t, pose.q, pose.t) for start in there):
        rivals = [h for h in rivals if not was_refined(h, ends)]
    rival = max(rivals, key=lambda h: h.score, default=None)
    if rival is not None:
        explains = rival.score
        # with the shadows of a better Sun it explains more; searched only if that may matter
        if here - explains < MAX_DEFICIT * here:
            explains = search_sun(target, patch, rival.q, rival.t, seen=rival.seen).score
        margin -= max(explains, 0.0)
    # two refined poses need not be far apart to be two answers
    for other in ends:
        if not same_end(other.pose, pose):
            margin = min(margin, best.score - other.score)
    view = _view(target, patch, best)
    like, covered = likeness(view, patch)
    evidence = image_evidence(target, best, s, margin)
    evidence = replace(evidence, likeness=like, covered=covered, burnt=burnt_share(view, patch))
    others = alternatives([(h.q, h.t, h.score) for h in ranked], pose.q, pose.t)
    return Selection(best, evidence, others, patch, tuple(ranked), tuple(ends), rival)


def _view(target: PreparedTarget, patch: ImagePatch, end: Hypothesis) -> Shading:
    """Return the drawing of a refined pose on a patch, the stored one if there is one."""
    if end.view is not None:
        return end.view
    return photo_draw(end.q, end.t, faces_of(target), patch, target.camera.pinhole, end.sun)


def _merit(target: PreparedTarget, patch: ImagePatch, end: Hypothesis) -> float:
    """Return the merit of a refined pose: its score times its likeness.

    Any drawing that covers a bright object explains much of the image; its likeness shows whether it is the target.
    """
    return end.score * max(likeness(_view(target, patch, end), patch)[0], 0.0)


def select_by_edges(target: PreparedTarget, found: List[Hypothesis], refined: List[Hypothesis]) -> Selection:
    """Select among hypotheses refined on edges, for a target without faces.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    found : list of Hypothesis
        Hypotheses of every region.
    refined : list of Hypothesis
        The best of them, refined by ``refine_on_edges``.
    """
    # distinct poses are compared by their whole support, near ones by their sub-pixel fit
    top = max(refined, key=lambda h: h.score)
    near = [h for h in refined if not differs(h.q, h.t, top.q, top.t)]
    best = max(near, key=lambda h: h.score + TIGHT_WEIGHT * (0.0 if h.edge_fit is None else h.edge_fit.tight))
    rivals = [h.score for h in (*found, *refined) if differs(h.q, h.t, best.q, best.t)]
    # the best pose of this neighbourhood against the best of any other
    margin = top.score - max(rivals, default=0.0)
    others = alternatives([(h.q, h.t, h.score) for h in (*found, *refined)], best.q, best.t)
    return Selection(best, edge_evidence(target, best, margin), others)


def image_evidence(target: PreparedTarget, best: Hypothesis, s: Support, margin: float) -> Evidence:
    """Return the evidence of a hypothesis that was judged by the whole image; ``s`` is its support by edges."""
    turn, shift = _sigmas(best.pose)
    return Evidence(
        drawn=s.drawn,
        explained=s.explained,
        outside=s.outside,
        margin=margin,
        found=s.drawn,
        tight=s.drawn,
        rms_px=0.0,
        sigma_rad=turn,
        sigma_share=shift,
        edges=len(s.visible),
        size_px=_size_px(target, best.pose),
        empty=best.source.field.empty,
        score=best.score,
    )


def edge_evidence(target: PreparedTarget, best: Hypothesis, margin: float) -> Evidence:
    """Return the evidence of a hypothesis that was refined on sub-pixel edges."""
    fit, s = best.edge_fit, best.support
    assert fit is not None  # noqa: S101 - it was refined on edges
    return replace(
        image_evidence(target, best, s, margin),
        found=fit.found,
        tight=fit.tight,
        rms_px=fit.rms_px,
        edges=int(fit.found * len(s.visible)),
        score=None,
    )


def _sigmas(pose: PoseFit) -> Tuple[float, float]:
    """Return one-sigma errors along the worst determined directions: attitude [rad], and position over range."""
    shift = largest_sigma(pose.covariance[3:, 3:])
    return largest_sigma(pose.covariance[:3, :3]), shift / float(np.linalg.norm(pose.t))


def _size_px(target: PreparedTarget, pose: PoseFit) -> float:
    """Return the diameter of the target's bounding sphere on the image [px]."""
    return 2 * target.radius_m * target.camera.fx_px / max(float(pose.t[2]), 1e-3)
