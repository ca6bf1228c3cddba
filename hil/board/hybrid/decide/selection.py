"""Hypothesis selection: the best refined pose, competing hypotheses, and the evidence for the decision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import Alternative, alternatives, differs
from flyaround.hil.board.hybrid.decide.confidence import Evidence
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import largest_sigma
from flyaround.hil.board.hybrid.hypotheses.edge_support import Support, support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.photometric import likeness, photo_draw, saturated_share
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# Deficit, as a share of the best score, above which no better Sun is searched for a competitor; hand-tuned, as is the
# value below.
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
    """

    best: Hypothesis
    evidence: Evidence
    alternatives: Tuple[Alternative, ...]
    patch: Optional[ImagePatch] = None
    ranked: Tuple[Hypothesis, ...] = ()

    @property
    def close(self) -> ImagePatch:
        """Patch on which poses were scored, for a selection by the whole image."""
        assert self.patch is not None  # noqa: S101 - a selection by edges has no such checks
        return self.patch


def select_by_image(
    target: PreparedTarget, patch: ImagePatch, ranked: List[Hypothesis], best: Hypothesis
) -> Selection:
    """Collect the evidence for the decision on a refined hypothesis.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Patch on which all hypotheses were scored, from ``refine_close_up``.
    ranked : list of Hypothesis
        Hypotheses aligned on the patch, best first.
    best : Hypothesis
        Refined hypothesis.
    """
    pose, field = best.pose, best.source.field
    s = support(target, pose.q, pose.t, field, alone=True)
    margin = initial_score = best.origin.score
    # a competitor that started where the best pose did is one if that pose converged far away
    rival = max((h for h in ranked if differs(h.q, h.t, pose.q, pose.t)), key=lambda h: h.score, default=None)
    if rival is not None:
        rival_score = rival.score
        # shadows of a better Sun may raise the competitor's score; searched only if that may matter
        if initial_score - rival_score < MAX_DEFICIT * initial_score:
            rival_score = search_sun(target, patch, rival.q, rival.t, visible_face=rival.visible_face).score
        margin -= max(rival_score, 0.0)
    view = best.view
    if view is None:
        view = photo_draw(pose.q, pose.t, faces_of(target), patch, target.camera.pinhole, best.sun)
    correlation, covered = likeness(view, patch)
    evidence = replace(
        image_evidence(target, best, s, margin),
        likeness=correlation,
        covered=covered,
        saturated=saturated_share(view, patch),
    )
    others = alternatives([(h.q, h.t, h.score) for h in ranked], pose.q, pose.t)
    return Selection(best, evidence, others, patch, tuple(ranked))


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
