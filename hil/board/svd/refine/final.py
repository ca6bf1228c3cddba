"""Poses aligned to the end on the picture, with their shadows, and what is said of the best of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Tuple

import numpy as np

from hil.board.svd.decide.confidence import Evidence
from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.geometry.image_patch import ImagePatch
from hil.board.svd.geometry.shading import Shading
from hil.board.svd.hypotheses.ambiguity import Alternative, alternatives, differs, largest_sigma
from hil.board.svd.hypotheses.edge_support import support
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.observation import Observation
from hil.board.svd.model.image_patch import craft_box, make_canvas
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.shadow_map import Sunlight
from hil.board.svd.refine.parallel import Ranked, faces_of, led
from hil.board.svd.refine.photometric import (
    JOINT_AT_END,
    PhotoFit,
    explained,
    likeness,
    photo_draw,
    photo_step,
)
from hil.board.svd.refine.shadows import shadowed

Array = np.ndarray

# An end that moved by more is aligned again, with shadows as they fall there, so many times in all [rad]: most are
# there after one, a few are 10 deg away at first. A score lower by more is a worse one; by far more, it leads away.
MOVED_RAD, ROUNDS, NO_WORSE, ASTRAY = float(np.radians(0.5)), 6, 0.003, 0.02

# Ends farther apart than this are two [rad].
OTHER_END_RAD = float(np.radians(5.0))

# A rival that is behind by this share of the best score is not asked for a better Sun.
FAR_BEHIND = 0.5

# Longest side of the picture for the final alignment [px], and the last blurs.
FINAL_PX, LAST_BLURS = 230, (0.3, 0.0)

# Those before them: share of that size, at first and after an end that moved far, and after one that did not. A smaller
# picture shows all that such blurs leave; before a texture of 105 development frames four fewer were fine with it.
EMPTY_WIDE, TEXTURED_WIDE = (0.65, (0.8, 0.5), (0.5,)), (1.0, (1.2, 0.8), (0.8,))

# The same of a round craft: its turn about the axis is told by small parts alone.
ROUND_FINAL_PX = 400

# An end that moved by more is far off [rad], and what is wider still comes first.
FAR_RAD, FAR_BLURS = float(np.radians(1.0)), (2.0, 1.3)


@dataclass(frozen=True, eq=False)
class End:
    """Where an alignment ends.

    Parameters
    ----------
    fit : the pose. score : how well the craft drawn there explains the picture, with the shadows of ``sun``.
    began : the same where the alignment began. drawn : the craft there on the canvas of the score, where kept.
    """

    fit: PhotoFit
    score: float
    sun: Optional[Sunlight]
    began: float
    drawn: Optional[Shading] = None


@dataclass(frozen=True, eq=False)
class Choice:
    """A pose chosen by the picture, and between what.

    Parameters
    ----------
    best : the pose with its edges' support. end : where its alignment ended. evidence, alternatives : what is said of
        it. close, ranked, starts, ends : as of ``conclude``. rival : the best other pose that was not followed.
    """

    best: Candidate
    end: End
    evidence: Evidence
    alternatives: Tuple[Alternative, ...]
    close: ImagePatch
    ranked: List[Ranked]
    starts: List[Ranked]
    ends: List[End]
    rival: Optional[Ranked] = None


def conclude(
    craft: PreparedTarget,
    frame: Observation,
    close: ImagePatch,
    ranked: List[Ranked],
    starts: List[Ranked],
    ends: List[End],
    *,
    sought: bool = False,
) -> Choice:
    """The best of the ends, and what the decision on it is made from.

    Parameters
    ----------
    close : canvas that all were judged on. ranked : every pose that was aligned there, the best first. starts, ends :
        those that were aligned to the end, and where each led; at least one. sought : whether these come of many places
        and of all about the winner.
    """
    winner = max(range(len(ends)), key=lambda k: ends[k].score)
    end, fit = ends[winner], ends[winner].fit
    c = starts[winner].start
    s = support(fit.q, fit.t, craft.samples, craft.occ, c.field, craft.camera, craft.spacing_m, alone=True)
    best = Candidate(fit.q, fit.t, s, c.field, c.region, c.likely)
    poses = [(r.fit.q, r.fit.t, r.score) for r in ranked]
    there = [(r, e) for r, e in zip(starts, ends) if same_end(e.fit, fit)]  # noqa: B905
    margin = here = max(e.began for _, e in there)
    rivals = [r for r in ranked if differs(r.fit.q, r.fit.t, fit.q, fit.t)]
    # what was followed to its end is what it is there: a start that led to where another one stood is no other answer;
    # but one that came from afar alone, of few poses asked, may as well have gone elsewhere
    if sought or not all(differs(r.fit.q, r.fit.t, fit.q, fit.t) for r, _ in there):
        rivals = [r for r in rivals if not led(r, starts)]
    rival = max(rivals, key=lambda r: r.score, default=None)
    if rival is not None:
        explains, at = rival.score, rival.fit
        # with the shadows of a better Sun it explains more: asked where that may settle anything
        if here - explains < FAR_BEHIND * here:
            explains = shadowed(craft, faces_of(craft), close, at.q, at.t, seen=rival.seen).score
        margin -= max(explains, 0.0)
    # two that were followed to their ends need not be far apart to be two answers
    for other in ends:
        if not same_end(other.fit, fit):
            margin = min(margin, end.score - other.score)
    evidence = picture_evidence(craft, best, fit, end.score, margin)
    drawn = end.drawn
    if drawn is None:
        drawn = photo_draw(fit.q, fit.t, faces_of(craft), close, craft.camera.pinhole, end.sun)
    like, covered = likeness(drawn, close)
    evidence = replace(evidence, likeness=like, covered=covered)
    frame.mark("verify")
    told = alternatives(poses, fit.q, fit.t)
    return Choice(best, end, evidence, told, close, ranked, starts, ends, rival)


def no_clearer(choice: Choice, than: Evidence) -> Choice:
    """A choice that stands out no more than was said of it before."""
    evidence = choice.evidence
    return replace(choice, evidence=replace(evidence, margin=min(evidence.margin, than.margin)))


def same_end(a: PhotoFit, b: PhotoFit) -> bool:
    """Whether two ends are one answer: the same attitude at the same place."""
    return bool(quat.angle_rad(a.q, b.q) <= OTHER_END_RAD) and not differs(a.q, a.t, b.q, b.t)


def finish(
    craft: PreparedTarget,
    frame: Observation,
    close: ImagePatch,
    start: PhotoFit,
    seen: Optional[Array] = None,
) -> End:
    """A pose aligned to the end, with the shadows the craft casts on itself.

    Parameters
    ----------
    seen : faces that ``close`` shows at the start, where they are drawn already.
    """
    box, longest = craft_box(craft, start.q, start.t), ROUND_FINAL_PX if craft.round else FINAL_PX
    share, at_first, near_by = TEXTURED_WIDE if frame.background < 0 else EMPTY_WIDE
    sharp = make_canvas(craft, frame, box, longest)
    wide = make_canvas(craft, frame, box, round(share * longest)) if share < 1 else sharp
    # drawn as large as it is only once it is there: from afar what is thin and bright attracts more as it was
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    faces, camera = faces_of(craft), craft.camera.pinhole
    best = None
    blurs: Tuple[float, ...] = at_first
    before = start
    here = shadowed(craft, faces, close, before.q, before.t, seen=seen)
    began, sun = here.score, here.sun
    for _ in range(ROUNDS):
        near = _stepped(craft, wide, before, sun, blurs)
        fit = _stepped(craft, exact, near, sun, LAST_BLURS)
        drawn = photo_draw(fit.q, fit.t, faces, close, camera, sun)
        score = explained(drawn, close)
        if best is None or score > best.score - NO_WORSE:
            best = End(fit, score, sun, began, drawn)
        elif score < best.score - ASTRAY:
            break
        moved = quat.angle_rad(before.q, fit.q)
        if moved < MOVED_RAD:
            break
        before = fit
        blurs = near_by
        if moved > FAR_RAD:
            # shadows fall elsewhere by now; of a Sun found from nearby they are where they were
            sun = shadowed(craft, faces, close, before.q, before.t, seen=drawn.seen).sun
            blurs = (*FAR_BLURS, *at_first)
    assert best is not None  # noqa: S101 - the first round always ends somewhere
    return best


def _stepped(
    craft: PreparedTarget,
    canvas: ImagePatch,
    fit: PhotoFit,
    sun: Optional[Sunlight],
    blurs: Tuple[float, ...],
) -> PhotoFit:
    """The pose some steps on, with many brightnesses found beside it."""
    faces, camera = faces_of(craft), craft.camera.pinhole
    for blur in blurs:
        shading = photo_draw(fit.q, fit.t, faces, canvas, camera, sun)
        step = photo_step(fit, shading, faces, canvas, camera, craft.radius_m, blur, joint=JOINT_AT_END)
        if step is None:
            break
        fit = step
    return fit


def picture_evidence(
    craft: PreparedTarget, best: Candidate, fit: PhotoFit, score: float, margin: float
) -> Evidence:
    """What the decision on a pose is made from that was judged by the whole picture."""
    turn = largest_sigma(fit.covariance[:3, :3])
    shift = largest_sigma(fit.covariance[3:, 3:])
    return Evidence(
        drawn=best.support.drawn,
        explained=best.support.explained,
        outside=best.support.outside,
        margin=margin,
        found=best.support.drawn,
        tight=best.support.drawn,
        rms_px=0.0,
        sigma_rad=turn,
        sigma_share=shift / float(np.linalg.norm(fit.t)),
        edges=len(best.support.visible),
        size_px=2 * craft.radius_m * craft.camera.fx_px / max(float(fit.t[2]), 1e-3),
        empty=best.field.empty,
        score=score,
    )
