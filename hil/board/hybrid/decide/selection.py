"""Hypothesis selection: the best of those refined to the end, its rivals, and the evidence for the decision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import Alternative, alternatives, differs
from flyaround.hil.board.hybrid.decide.confidence import Evidence, least_margin
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
from flyaround.hil.board.hybrid.refine.final import ROUNDS, refine_to_end
from flyaround.hil.board.hybrid.refine.photometric import burnt_share, likeness, photo_draw
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# How many are refined to the end, and with what share of the best score; and where a first round did not settle it.
FINALS, FINAL_LEAD = 2, 0.85
ALL_FINALS, ALL_FINAL_LEAD = 3, 0.75

# Rounds of that in the light of lamps, where ends are held against near leans afterwards.
LAMPS_ROUNDS = 3

# Rivals that are refined to their ends as well where they seem to explain as much as the winner.
TIES = 2

# Score from which no other near pose is asked.
SURE_SCORE = 0.27

# A rival that is behind by this share of the best score is not asked for a better Sun.
FAR_BEHIND = 0.5

# What a sharp sub-pixel fit weighs against the total support among near poses.
TIGHT_WEIGHT = 0.5


@dataclass(frozen=True, eq=False)
class Selection:
    """A hypothesis selected, and between what.

    Parameters
    ----------
    best : refined to its end. evidence : what the decision on it is made from. alternatives : distinct poses.
    patch, ranked, ends : as of ``select``. rival : the best other hypothesis that was not refined to its end.
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
        """The patch that ends were scored on, of a selection by the image."""
        assert self.patch is not None  # noqa: S101 - a selection by edges has no such checks
        return self.patch

    def no_clearer(self, than: Evidence) -> Selection:
        """The same, standing out no more than was said of it before."""
        margin = min(self.evidence.margin, than.margin)
        return replace(self, evidence=replace(self.evidence, margin=margin))


def select_by_image(
    target: PreparedTarget,
    frame: Observation,
    regime: Regime,
    patch: ImagePatch,
    ranked: List[Hypothesis],
    *,
    thorough: bool = False,
) -> Selection:
    """The best hypotheses refined to their ends, and the best of these.

    Parameters
    ----------
    patch, ranked : of ``refine_close_up``. thorough : refine more of them to their ends.
    """
    # poses half-way there rank by chance: the end decides
    ends: List[Hypothesis] = []
    rounds = LAMPS_ROUNDS if regime is Regime.LAMPS else ROUNDS
    most, lead = (ALL_FINALS, ALL_FINAL_LEAD) if thorough else (FINALS, FINAL_LEAD)
    for h in ranked[:most]:
        if h.score <= lead * ranked[0].score and h is not ranked[0]:
            continue
        # a pose that nearly is another ends where that does: asked only where acceptance hangs on a hundredth
        starts = [e.origin for e in ends]
        if ends and len(without_duplicates([*starts, h])) == len(ends) and ends[0].score > SURE_SCORE:
            continue
        ends.append(refine_to_end(target, frame, patch, h, rounds))
    selection = select(target, patch, ranked, ends, thorough=thorough)
    # a tie is one between ends: a rival on its way may lead to the winner, or fall behind
    for _ in range(TIES):
        rival = selection.rival
        if rival is None or selection.evidence.margin >= least_margin(selection.evidence):
            break
        if was_refined(rival, ends):  # it is where it leads already
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
    """The best of those refined to their ends, and what the decision on it is made from.

    Parameters
    ----------
    patch : that all were scored on. ranked : every hypothesis that was aligned there, the best first.
    ends : those that were refined to their ends, at least one.
    thorough : whether these come of many places and of all about the winner.
    """
    best = max(ends, key=lambda e: _merit(target, patch, e))
    pose, field = best.pose, best.source.field
    s = support(
        pose.q, pose.t, target.samples, target.occ, field, target.camera, target.spacing_m, alone=True
    )
    there = [e.origin for e in ends if same_end(e.pose, pose)]
    margin = here = max(start.score for start in there)
    rivals = [h for h in ranked if differs(h.q, h.t, pose.q, pose.t)]
    # what was refined to its end is what it is there: a start that led to where another one stood is no other answer;
    # but one that came from afar alone, of few poses asked, may as well have gone elsewhere
    if thorough or not all(differs(start.q, start.t, pose.q, pose.t) for start in there):
        rivals = [h for h in rivals if not was_refined(h, ends)]
    rival = max(rivals, key=lambda h: h.score, default=None)
    if rival is not None:
        explains = rival.score
        # with the shadows of a better Sun it explains more: asked where that may settle anything
        if here - explains < FAR_BEHIND * here:
            explains = search_sun(target, faces_of(target), patch, rival.q, rival.t, seen=rival.seen).score
        margin -= max(explains, 0.0)
    # two that were refined to their ends need not be far apart to be two answers
    for other in ends:
        if not same_end(other.pose, pose):
            margin = min(margin, best.score - other.score)
    like, covered = _likeness(target, patch, best)
    burnt = burnt_share(_view(target, patch, best), patch)
    evidence = replace(image_evidence(target, best, s, margin), likeness=like, covered=covered, burnt=burnt)
    told = alternatives([(h.q, h.t, h.score) for h in ranked], pose.q, pose.t)
    return Selection(best, evidence, told, patch, tuple(ranked), tuple(ends), rival)


def _view(target: PreparedTarget, patch: ImagePatch, end: Hypothesis) -> Shading:
    """An end drawn on a patch, as it was if that is kept."""
    if end.view is not None:
        return end.view
    return photo_draw(end.q, end.t, faces_of(target), patch, target.camera.pinhole, end.sun)


def _likeness(target: PreparedTarget, patch: ImagePatch, end: Hypothesis) -> Tuple[float, float]:
    """How an end looks like the picture, see ``photometric.likeness``."""
    return likeness(_view(target, patch, end), patch)


def _merit(target: PreparedTarget, patch: ImagePatch, end: Hypothesis) -> float:
    """What ends are ranked by: the share of the picture that one explains, by how much it looks like it.

    A drawing that covers what is bright explains much of it whatever is there; its likeness tells.
    """
    return end.score * max(_likeness(target, patch, end)[0], 0.0)


def select_by_edges(target: PreparedTarget, found: List[Hypothesis], refined: List[Hypothesis]) -> Selection:
    """The best of hypotheses refined on edges, for a target without faces.

    Parameters
    ----------
    found : hypotheses of every region. refined : of ``refine_on_edges``.
    """
    # distinct poses are told apart by the whole support, near ones by how sharply they fit
    top = max(refined, key=lambda h: h.score)
    near = [h for h in refined if not differs(h.q, h.t, top.q, top.t)]
    best = max(near, key=lambda h: h.score + TIGHT_WEIGHT * (0.0 if h.edge_fit is None else h.edge_fit.tight))
    rivals = [h.score for h in (*found, *refined) if differs(h.q, h.t, best.q, best.t)]
    # what the best pose of this neighbourhood scores against the best of any other
    margin = top.score - max(rivals, default=0.0)
    told = alternatives([(h.q, h.t, h.score) for h in (*found, *refined)], best.q, best.t)
    return Selection(best, edge_evidence(target, best, margin), told)


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
    """One-sigma errors along the worst held directions: attitude [rad], and position over range."""
    shift = largest_sigma(pose.covariance[3:, 3:])
    return largest_sigma(pose.covariance[:3, :3]), shift / float(np.linalg.norm(pose.t))


def _size_px(target: PreparedTarget, pose: PoseFit) -> float:
    """Diameter of the target's sphere on the image [px]."""
    return 2 * target.radius_m * target.camera.fx_px / max(float(pose.t[2]), 1e-3)
