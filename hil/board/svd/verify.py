"""The choice between poses by the whole picture: each draws the craft, and the best drawing wins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Tuple

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.canvas import craft_box, make_canvas, pinhole_box
from hil.board.svd.confidence import LEAST_SCORE, Evidence
from hil.board.svd.distinct import alternatives, differs
from hil.board.svd.frame import Alternative, Candidate, Craft, Frame
from hil.board.svd.levels import shade
from hil.board.svd.photometric import JOINT_AT_END, PhotoFit, photo_align, photo_likeness, photo_score
from hil.board.svd.score import support
from hil.board.svd.search import MARGIN, twins
from hil.board.svd.shade import Canvas, Faces, draw_faces

Array = np.ndarray

# Candidates of a region looked at, poses compared of them, and how far apart these are [rad].
LOOKED_AT, LEADERS, SPREAD_RAD = 24, 4, float(np.radians(6.0))

# What a unit of the first look's log-likelihood counts against the score.
LIKELY_WEIGHT = 0.01

# An alignment that leaves the size it started from by more has gone astray: logarithm of the range.
ASTRAY = 0.3

# How many are compared close up with the winner, and with what share of its score a twin is looked at again.
FINALISTS, TWIN_SHARE = 3, 0.6

# How many go to the end, and with what share of the best score.
FINALS, FINAL_LEAD = 2, 0.85

# An end that moved by more is aligned once more, with shadows as they fall there [rad].
MOVED_RAD, NO_WORSE = float(np.radians(0.7)), 0.003

# Poses nearer than this to a better one end where it does: 30 of 30 pairs within 0.4 deg, 20 mm [rad, share of range].
SAME_RAD, SAME_SHARE = float(np.radians(1.0)), 0.03
SURE_SCORE = LEAST_SCORE + 0.02

# Longest side of the pictures they are compared on, far and close up, and of the one for the final alignment [px];
# the blurs of each.
FIRST_PX, FIRST_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# Against a texture clutter outweighs what few pixels of the craft can say.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)
SMALL_PX, SMALL_BLURS = 120, (1.2, 1.2, 0.6)
FINAL_PX, FINAL_BLURS = 230, (2.0, 1.2, 0.8, 0.4, 0.0, 0.0, 0.0)

# Margin round a place of the first look, which holds all of the craft.
LOOK_MARGIN = 0.1


@dataclass(frozen=True, eq=False)
class Ranked:
    """A pose aligned on the picture, its score, and where it started."""

    score: float
    fit: PhotoFit
    start: Candidate

    def candidate(self) -> Candidate:
        """The aligned pose with the evidence of its start."""
        return Candidate(self.fit.q, self.fit.t, self.start.support, self.start.field, self.start.region)


def choose_by_picture(
    craft: Craft, frame: Frame, found: List[Candidate]
) -> Tuple[Candidate, PhotoFit, Evidence, Tuple[Alternative, ...]]:
    """Distinct leaders aligned and judged by the whole picture, then the winner's twins, the best to the end.

    Parameters
    ----------
    found : candidates of every region, best first, at least one.
    """
    ranked: List[Ranked] = []
    # edges of one region say nothing of another's: each sends its own leaders
    for region in dict.fromkeys(c.region for c in found):
        own = [c for c in found if c.region == region][:LOOKED_AT]
        margin = LOOK_MARGIN if region.source == "look" else MARGIN
        height, width = frame.image.shape
        textured = region.source == "look" and frame.background < 0
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (FIRST_PX, FIRST_BLURS)
        box = pinhole_box(craft.camera, region.grown(margin, width, height))
        small = make_canvas(craft, frame, box, longest)
        looks = [_score(craft, small, c.q, c.t) + LIKELY_WEIGHT * c.likely for c in own]
        leaders = spread_out([own[k] for k in np.argsort(looks)[::-1]], LEADERS)
        ranked += _judge(craft, small, leaders, blurs)
    judged = len(ranked)
    ranked.sort(key=lambda r: -r.score)
    frame.mark("picture")
    # once more close up: the winner, who came after it, and its near-symmetries, who must have their chance
    c = ranked[0].candidate()
    close = make_canvas(craft, frame, craft_box(craft, c.q, c.t), SMALL_PX)
    q, t = twins(craft, [c])
    others = [r.candidate() for r in apart(ranked) if r.start.region == c.region and r is not ranked[0]]
    others = others[:FINALISTS]
    # against a texture a few degrees cost a pose most of its score: there every twin is aligned
    empty = frame.background >= 0
    enough = TWIN_SHARE * _score(craft, close, c.q, c.t) if empty else 0.0
    others += [
        Candidate(q[k], t[k], c.support, c.field, c.region, c.likely)
        for k in range(len(q))
        if all(quat.angle_rad(q[k], r.fit.q) > SPREAD_RAD for r in ranked)
        and (not empty or _score(craft, close, q[k], t[k]) > enough)
    ]
    ranked = _judge(craft, close, [c, *others], SMALL_BLURS)
    frame.keep("ranked", ranked)
    frame.count("judged", judged + len(ranked))
    frame.mark("twins")
    # poses half-way there rank by chance: the end decides
    ends: List[Ranked] = []
    finals: List[Tuple[PhotoFit, float]] = []
    for r in ranked[:FINALS]:
        if r.score <= FINAL_LEAD * ranked[0].score and r is not ranked[0]:
            continue
        # a pose that nearly is another ends where that does: asked only where acceptance hangs on a hundredth
        if ends and len(apart([*ends, r])) == len(ends) and finals[0][1] > SURE_SCORE:
            continue
        ends.append(r)
        finals.append(_finish(craft, frame, close, r.fit))
    best_end = max(range(len(ends)), key=lambda k: finals[k][1])
    fit, score = finals[best_end]
    frame.mark("refine")
    c = ends[best_end].start
    s = support(fit.q, fit.t, craft.samples, craft.occ, c.field, craft.camera, craft.spacing_m)
    best = Candidate(fit.q, fit.t, s, c.field, c.region, c.likely)
    poses = [(r.fit.q, r.fit.t, r.score) for r in ranked]
    rival = max((r[2] for r in poses if differs(r[0], r[1], fit.q, fit.t)), default=0.0)
    evidence = picture_evidence(craft, best, fit, score, ends[best_end].score - max(rival, 0.0))
    likeness, covered = photo_likeness(fit.q, fit.t, _faces(craft), close, craft.camera.pinhole)
    evidence = replace(evidence, likeness=likeness, covered=covered)
    frame.mark("verify")
    return best, fit, evidence, alternatives(poses, fit.q, fit.t)


def _finish(
    craft: Craft, frame: Frame, close: Canvas, start: PhotoFit, *, again: bool = True
) -> Tuple[PhotoFit, float]:
    """A pose aligned to the end, with the shadows the craft casts on itself, and its score."""
    faces, camera = _faces(craft), craft.camera.pinhole
    q, t = start.q, start.t
    sun = None
    if craft.suns is not None:
        R = quat.matrix(q)
        shading = shade(faces, draw_faces(faces, faces.order(-R.T @ t), camera, R, t, close), close)
        sun = craft.suns.find(faces, shading, close, camera, R, t)
    canvas = make_canvas(craft, frame, craft_box(craft, q, t), FINAL_PX)
    fit = photo_align(q, t, faces, canvas, camera, craft.radius_m, FINAL_BLURS, sun, joint=JOINT_AT_END)
    score = _score(craft, close, fit.q, fit.t)
    if again and quat.angle_rad(q, fit.q) > MOVED_RAD:
        second = _finish(craft, frame, close, fit, again=False)
        return second if second[1] > score - NO_WORSE else (fit, score)
    return fit, score


def apart(ranked: List[Ranked]) -> List[Ranked]:
    """Poses without those that are nearly one that comes before."""
    out: List[Ranked] = []
    for r in ranked:
        if all(
            quat.angle_rad(r.fit.q, o.fit.q) > SAME_RAD
            or np.linalg.norm(r.fit.t - o.fit.t) > SAME_SHARE * np.linalg.norm(o.fit.t)
            for o in out
        ):
            out.append(r)
    return out


def _faces(craft: Craft) -> Faces:
    faces = craft.model.faces
    assert faces is not None  # noqa: S101 - the caller asked
    return faces


def _score(craft: Craft, canvas: Canvas, q: Array, t: Array) -> float:
    return photo_score(q, t, _faces(craft), canvas, craft.camera.pinhole)


def _judge(
    craft: Craft, canvas: Canvas, candidates: List[Candidate], blurs: Tuple[float, ...]
) -> List[Ranked]:
    """Candidates aligned on a canvas and scored by it, the best first."""
    out = []
    for c in candidates:
        fit = photo_align(c.q, c.t, _faces(craft), canvas, craft.camera.pinhole, craft.radius_m, blurs)
        score = _score(craft, canvas, fit.q, fit.t)
        if abs(np.log(max(fit.t[2], 1e-3) / max(c.t[2], 1e-3))) > ASTRAY:
            score *= 0.5
        out.append(Ranked(score, fit, c))
    return sorted(out, key=lambda r: -r.score)


def picture_evidence(craft: Craft, best: Candidate, fit: PhotoFit, score: float, margin: float) -> Evidence:
    """What the decision on a pose is made from that was judged by the whole picture."""
    turn = float(np.sqrt(np.max(np.linalg.eigvalsh(fit.covariance[:3, :3]))))
    shift = float(np.sqrt(np.max(np.linalg.eigvalsh(fit.covariance[3:, 3:]))))
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


def spread_out(pool: List[Candidate], keep: int) -> List[Candidate]:
    """The first candidates that differ from each other in attitude."""
    out: List[Candidate] = []
    for c in pool:
        if len(out) >= keep:
            break
        if all(quat.angle_rad(c.q, o.q) > SPREAD_RAD for o in out):
            out.append(c)
    return out
