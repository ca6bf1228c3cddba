"""Hypothesis selection: the best refined pose, competing hypotheses, and the evidence for the decision."""

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
    same_optimum,
    was_refined,
    without_duplicates,
)
from flyaround.hil.board.hybrid.hypotheses.edge_support import Support, support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.final import MAX_ROUNDS, refine_to_convergence
from flyaround.hil.board.hybrid.refine.photometric import likeness, photo_draw, saturated_share
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# Maximum number of hypotheses that are refined, and their minimum share of the best score; then the same in a second
# round. Hand-tuned on development frames, as are the values below.
MAX_OPTIMA, OPTIMUM_SHARE = 2, 0.85
THOROUGH_OPTIMA, THOROUGH_SHARE = 3, 0.75

# Maximum number of alignments under lamps.
LAMPS_ROUNDS = 3

# Maximum number of competitors that are also refined because they explain about as much as the best hypothesis.
MAX_TIES = 2

# Score above which no other hypothesis close to the best one is refined.
CLEAR_SCORE = 0.27

# Deficit, as a share of the best score, above which no better Sun is searched for a competitor.
MAX_DEFICIT = 0.5

# Weight of the share of samples with a very close sub-pixel edge against total support, among close poses.
TIGHT_WEIGHT = 0.5


@dataclass(frozen=True, eq=False)
class Selection:
    """A selected hypothesis and its competitors.

    Parameters
    ----------
    best : Hypothesis
        Selected hypothesis, refined.
    evidence : Evidence
        Evidence for the decision on it.
    alternatives : tuple of Alternative
        Distinct other poses.
    patch : ImagePatch, optional
        Patch on which all hypotheses were scored; None for a selection by edges.
    ranked : tuple of Hypothesis
        Hypotheses aligned on the patch, best first.
    optima : tuple of Hypothesis
        Refined hypotheses.
    rival : Hypothesis, optional
        Best competitor that was not refined.
    """

    best: Hypothesis
    evidence: Evidence
    alternatives: Tuple[Alternative, ...]
    patch: Optional[ImagePatch] = None
    ranked: Tuple[Hypothesis, ...] = ()
    optima: Tuple[Hypothesis, ...] = ()
    rival: Optional[Hypothesis] = None

    @property
    def close(self) -> ImagePatch:
        """Patch on which poses were scored, for a selection by the whole image."""
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
    """Refine the best hypotheses and select among them.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    regime : Regime
        Illumination regime of the image.
    patch : ImagePatch
        Patch of the target from ``refine_close_up``.
    ranked : list of Hypothesis
        Hypotheses aligned on the patch, best first.
    thorough : bool
        Refine more of them.
    """
    # scores before convergence do not rank hypotheses, so the best ones are refined first
    optima: List[Hypothesis] = []
    rounds = LAMPS_ROUNDS if regime is Regime.LAMPS else MAX_ROUNDS
    most, lead = (THOROUGH_OPTIMA, THOROUGH_SHARE) if thorough else (MAX_OPTIMA, OPTIMUM_SHARE)
    for h in ranked[:most]:
        if h.score <= lead * ranked[0].score and h is not ranked[0]:
            continue
        # close poses converge to the same optimum: refine both only if a small gain may decide on acceptance
        starts = [e.origin for e in optima]
        if optima and len(without_duplicates([*starts, h])) == len(optima) and optima[0].score > CLEAR_SCORE:
            continue
        optima.append(refine_to_convergence(target, frame, patch, h, rounds))
    selection = select(target, patch, ranked, optima, thorough=thorough)
    # a competitor that has not converged may converge to the best pose, or fall behind
    for _ in range(MAX_TIES):
        rival = selection.rival
        if rival is None or selection.evidence.margin >= min_margin(selection.evidence):
            break
        if was_refined(rival, optima):
            break
        optima.append(refine_to_convergence(target, frame, patch, rival))
        selection = select(target, patch, ranked, optima, thorough=thorough)
    return selection


def select(
    target: PreparedTarget,
    patch: ImagePatch,
    ranked: List[Hypothesis],
    optima: List[Hypothesis],
    *,
    thorough: bool = False,
) -> Selection:
    """Select the best refined hypothesis and collect the evidence for the decision on it.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Patch on which all hypotheses were scored.
    ranked : list of Hypothesis
        Hypotheses aligned on the patch, best first.
    optima : list of Hypothesis
        Refined hypotheses, at least one.
    thorough : bool
        True if the hypotheses come from many locations and include variants of the best one.
    """
    best = max(optima, key=lambda e: _merit(target, patch, e))
    pose, field = best.pose, best.source.field
    s = support(target, pose.q, pose.t, field, alone=True)
    origins = [e.origin for e in optima if same_optimum(e.pose, pose)]
    margin = initial_score = max(start.score for start in origins)
    rivals = [h for h in ranked if differs(h.q, h.t, pose.q, pose.t)]
    # a hypothesis that converged to the best pose is no competitor; but if the only one started far away, among few
    # hypotheses, its convergence may be accidental
    if thorough or not all(differs(start.q, start.t, pose.q, pose.t) for start in origins):
        rivals = [h for h in rivals if not was_refined(h, optima)]
    rival = max(rivals, key=lambda h: h.score, default=None)
    if rival is not None:
        rival_score = rival.score
        # shadows of a better Sun may raise the competitor's score; searched only if that may matter
        if initial_score - rival_score < MAX_DEFICIT * initial_score:
            rival_score = search_sun(target, patch, rival.q, rival.t, visible_face=rival.visible_face).score
        margin -= max(rival_score, 0.0)
    # two refined poses may be distinct optima even if they are close
    for other in optima:
        if not same_optimum(other.pose, pose):
            margin = min(margin, best.score - other.score)
    view = _view(target, patch, best)
    correlation, covered = likeness(view, patch)
    evidence = image_evidence(target, best, s, margin)
    evidence = replace(
        evidence, likeness=correlation, covered=covered, saturated=saturated_share(view, patch)
    )
    others = alternatives([(h.q, h.t, h.score) for h in ranked], pose.q, pose.t)
    return Selection(best, evidence, others, patch, tuple(ranked), tuple(optima), rival)


def _view(target: PreparedTarget, patch: ImagePatch, optimum: Hypothesis) -> Shading:
    """Return the rendering of a refined pose on a patch, cached if available."""
    if optimum.view is not None:
        return optimum.view
    return photo_draw(optimum.q, optimum.t, faces_of(target), patch, target.camera.pinhole, optimum.sun)


def _merit(target: PreparedTarget, patch: ImagePatch, optimum: Hypothesis) -> float:
    """Return the merit of a refined pose: its score times its likeness.

    Any rendering that covers a bright object explains much of the image; likeness shows whether that is the target.
    """
    return optimum.score * max(likeness(_view(target, patch, optimum), patch)[0], 0.0)


def select_by_edges(
    target: PreparedTarget, proposed: List[Hypothesis], refined: List[Hypothesis]
) -> Selection:
    """Select among hypotheses refined on edges, for a target without faces.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    proposed : list of Hypothesis
        Hypotheses of every region.
    refined : list of Hypothesis
        Best hypotheses, refined by ``refine_on_edges``.
    """
    # distinct poses are compared by total support, close ones by their sub-pixel fit
    top = max(refined, key=lambda h: h.score)
    neighbours = [h for h in refined if not differs(h.q, h.t, top.q, top.t)]
    best = max(
        neighbours, key=lambda h: h.score + TIGHT_WEIGHT * (0.0 if h.edge_fit is None else h.edge_fit.tight)
    )
    rivals = [h.score for h in (*proposed, *refined) if differs(h.q, h.t, best.q, best.t)]
    # the best pose near the optimum against the best distinct one
    margin = top.score - max(rivals, default=0.0)
    others = alternatives([(h.q, h.t, h.score) for h in (*proposed, *refined)], best.q, best.t)
    return Selection(best, edge_evidence(target, best, margin), others)


def image_evidence(target: PreparedTarget, best: Hypothesis, s: Support, margin: float) -> Evidence:
    """Return the evidence for a hypothesis scored by the whole image; ``s`` is its edge support."""
    turn, shift = _sigmas(best.pose)
    return Evidence(
        drawn=s.drawn,
        explained=s.explained,
        outside=s.outside,
        margin=margin,
        matched_share=s.drawn,
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
    """Return the evidence for a hypothesis refined on sub-pixel edges."""
    fit, s = best.edge_fit, best.support
    assert fit is not None  # noqa: S101 - it was refined on edges
    return replace(
        image_evidence(target, best, s, margin),
        matched_share=fit.matched_share,
        tight=fit.tight,
        rms_px=fit.rms_px,
        edges=int(fit.matched_share * len(s.visible)),
        score=None,
    )


def _sigmas(pose: PoseFit) -> Tuple[float, float]:
    """Return one-sigma errors along the least determined directions: attitude [rad], and position over range."""
    shift = largest_sigma(pose.covariance[3:, 3:])
    return largest_sigma(pose.covariance[:3, :3]), shift / float(np.linalg.norm(pose.t))


def _size_px(target: PreparedTarget, pose: PoseFit) -> float:
    """Return the diameter of the target's bounding sphere in the image [px]."""
    return 2 * target.radius_m * target.camera.fx_px / max(float(pose.t[2]), 1e-3)
