"""The choice between poses by the whole picture: each draws the craft, and the best drawing wins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Tuple

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.canvas import Box, craft_box, make_canvas, pinhole_box
from hil.board.svd.confidence import Evidence
from hil.board.svd.course import (
    SPREAD_RAD,
    Left,
    Ranked,
    align_together,
    apart,
    begin,
    faces_of,
    leaning,
    spread_out,
    with_shadows,
)
from hil.board.svd.distinct import alternatives, differs
from hil.board.svd.frame import Alternative, Candidate, Craft, Frame
from hil.board.svd.photometric import (
    JOINT_AT_END,
    PhotoFit,
    photo_draw,
    photo_likeness,
    photo_score,
    photo_step,
)
from hil.board.svd.score import support
from hil.board.svd.search import MARGIN, twins
from hil.board.svd.shade import Canvas
from hil.board.svd.shadowed import shadowed
from hil.board.svd.sunlight import Sunlight

Array = np.ndarray

# Candidates of a region looked at, and poses compared of them.
LOOKED_AT, LEADERS = 24, 4

# The same where those did not settle it, with how many go to the end: all that were found.
ALL_LEADERS, ALL_FINALISTS, ALL_FINALS, ALL_FINAL_LEAD = 6, 4, 3, 0.75

# Of a region's own edges so many are looked at with shadows; how much of a pose another one covers at the same place.
LIT_OF_EDGES, SAME_PLACE = 8, 0.5

# What a unit of the first look's log-likelihood counts against the score.
LIKELY_WEIGHT = 0.01

# How many are compared close up with the winner, and with what share of its score a twin is looked at again.
FINALISTS, TWIN_SHARE = 3, 0.6

# How many go to the end, and with what share of the best score.
FINALS, FINAL_LEAD = 2, 0.85

# An end that moved by more is aligned again, with shadows as they fall there, so many times in all [rad]; a score
# that is lower by more is a worse one.
MOVED_RAD, ROUNDS, NO_WORSE = float(np.radians(0.5)), 2, 0.003

# Ends farther apart than this are two [rad].
OTHER_END_RAD = float(np.radians(5.0))

# Score from which no other near pose is asked.
SURE_SCORE = 0.27

# Longest side of the pictures they are compared on, far and close up, and of the one for the final alignment [px];
# the blurs of each.
FIRST_PX, FIRST_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# Against a texture clutter outweighs what few pixels of the craft can say.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)
SMALL_PX, SMALL_BLURS = 120, (1.2, 1.2, 0.6)
FINAL_PX, FINAL_BLURS, LAST_BLURS = 230, (2.0, 1.2, 0.8), (0.3, 0.0)
# The first ones of an alignment again after one that moved by less [rad].
FAR_RAD, NEAR_BLURS = float(np.radians(1.0)), (0.8,)

# Who goes on with each step: share of the best score, and least distance from a better one [rad]. On 76 development
# frames the winner had 0.6 of the best after two steps far off, 0.78 at once close up, and of poses within these angles
# the better one ended as near to the truth as the others.
FIRST_LEFT = (Left(-9.0, 0.0), Left(-9.0, 0.03), Left(0.5, 0.1), Left(0.6, 0.1))
SMALL_LEFT = (Left(0.3, 0.07), Left(0.6, 0.07), Left(0.7, 0.07))

# Poses that lean to another side start far off: the tilt of what is nearly flat has near minima.
LEANING_BLURS = (2.0, 2.0, 2.0, 1.2, 1.2, 0.6)
LEANING_LEFT = (Left(-9.0, 0.0), Left(-9.0, 0.03), Left(-9.0, 0.05), *SMALL_LEFT)

# Margin round a place of the first look, which holds all of the craft.
LOOK_MARGIN = 0.1


@dataclass(frozen=True, eq=False)
class End:
    """Where an alignment ends.

    Parameters
    ----------
    fit : the pose. score : how well the craft drawn there explains the picture, with the shadows of ``sun``.
    began : the same where the alignment began.
    """

    fit: PhotoFit
    score: float
    sun: Optional[Sunlight]
    began: float


def align_leaders(
    craft: Craft, frame: Frame, found: List[Candidate], keep: int, *, shadows: bool = False
) -> List[Ranked]:
    """The candidates of each region that look best, aligned on a small picture of it; the best first.

    Parameters
    ----------
    found : candidates of every region, best first. keep : aligned of each region at most.
    shadows : draw them with the shadows that the picture wants; of a region's own edges few are looked at then.
    """
    ranked: List[Ranked] = []
    # edges of one region say nothing of another's: each sends its own leaders
    for region in dict.fromkeys(c.region for c in found):
        looked = region.source == "look"
        own = [c for c in found if c.region == region]
        own = own[: LIT_OF_EDGES if shadows and not looked else LOOKED_AT]
        margin = LOOK_MARGIN if looked else MARGIN
        height, width = frame.image.shape
        textured = looked and frame.background < 0
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (FIRST_PX, FIRST_BLURS)
        box = pinhole_box(craft.camera, region.grown(margin, width, height))
        small = make_canvas(craft, frame, box, longest)
        courses = [begin(craft, small, c) for c in own]
        if shadows:
            courses = [with_shadows(craft, small, c) for c in courses]
        courses.sort(key=lambda c: -c.score - LIKELY_WEIGHT * c.start.likely)
        courses = spread_out(courses, keep)
        if not shadows:
            courses = [with_shadows(craft, small, c) for c in courses]
        ranked += align_together(craft, small, courses, blurs, FIRST_LEFT)
    frame.count("judged", len(ranked))
    frame.mark("picture")
    return sorted(ranked, key=lambda r: -r.score)


def choose_by_picture(
    craft: Craft, frame: Frame, leaders: List[Ranked], *, thorough: bool = False
) -> Tuple[Candidate, PhotoFit, Evidence, Tuple[Alternative, ...]]:
    """The best leaders and the winner's twins judged close up, the best of them aligned to the end.

    Parameters
    ----------
    leaders : of ``align_leaders``, the best first, at least one.
    thorough : ask more leaders, every twin, and poses leaning about the winner, all with their shadows: a near
        minimum may have held it.
    """
    c = leaders[0].candidate()
    box = craft_box(craft, c.q, c.t)
    others = [r.candidate() for r in apart(leaders) if r is not leaders[0]]
    if thorough:
        others = [o for o in others if _overlap(box, craft_box(craft, o.q, o.t)) > SAME_PLACE][:ALL_FINALISTS]
        boxes = np.array([box, *(craft_box(craft, o.q, o.t) for o in others)])
        (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        box = int(x0), int(y0), int(x1), int(y1)
    else:
        others = [o for o in others if o.region == c.region][:FINALISTS]
    close = make_canvas(craft, frame, box, SMALL_PX)
    courses = [begin(craft, close, o) for o in (c, *others)]
    q, t = twins(craft, [c])
    around = [
        begin(craft, close, Candidate(q[k], t[k], c.support, c.field, c.region, c.likely))
        for k in range(len(q))
        if all(quat.angle_rad(q[k], r.fit.q) > SPREAD_RAD for r in leaders)
    ]
    # against a texture a few degrees cost a pose most of its score: there every twin is aligned
    every = thorough or frame.background < 0
    courses += [o for o in around if every or o.score > TWIN_SHARE * courses[0].score]
    courses = [with_shadows(craft, close, o) for o in courses]
    ranked = align_together(craft, close, courses, SMALL_BLURS, SMALL_LEFT)
    judged = len(ranked)
    if thorough:
        about = [begin(craft, close, lean) for lean in leaning(craft, ranked[0].candidate())]
        about = [with_shadows(craft, close, lean) for lean in about]
        ranked += align_together(craft, close, about, LEANING_BLURS, LEANING_LEFT)
        judged = len(ranked)
        ranked = apart(sorted(ranked, key=lambda r: -r.score))
    frame.keep("ranked", ranked)
    frame.count("judged", judged)
    frame.mark("twins")
    # poses half-way there rank by chance: the end decides
    starts: List[Ranked] = []
    ends: List[End] = []
    most, lead = (ALL_FINALS, ALL_FINAL_LEAD) if thorough else (FINALS, FINAL_LEAD)
    for r in ranked[:most]:
        if r.score <= lead * ranked[0].score and r is not ranked[0]:
            continue
        # a pose that nearly is another ends where that does: asked only where acceptance hangs on a hundredth
        if starts and len(apart([*starts, r])) == len(starts) and ends[0].score > SURE_SCORE:
            continue
        starts.append(r)
        ends.append(_finish(craft, frame, close, r.fit))
    winner = max(range(len(ends)), key=lambda k: ends[k].score)
    end, fit = ends[winner], ends[winner].fit
    frame.mark("refine")
    c = starts[winner].start
    s = support(fit.q, fit.t, craft.samples, craft.occ, c.field, craft.camera, craft.spacing_m)
    best = Candidate(fit.q, fit.t, s, c.field, c.region, c.likely)
    poses = [(r.fit.q, r.fit.t, r.score) for r in ranked]
    rivals = [p for p in poses if differs(p[0], p[1], fit.q, fit.t)]
    margin = end.began
    if rivals:
        rival = max(rivals, key=lambda p: p[2])
        margin -= max(shadowed(craft, faces_of(craft), close, rival[0], rival[1]).score, 0.0)
    # two that were followed to their ends need not be far apart to be two answers
    for other in ends:
        if quat.angle_rad(other.fit.q, fit.q) > OTHER_END_RAD:
            margin = min(margin, end.score - other.score)
    evidence = picture_evidence(craft, best, fit, end.score, margin)
    faces, camera = faces_of(craft), craft.camera.pinhole
    likeness, covered = photo_likeness(fit.q, fit.t, faces, close, camera, end.sun)
    evidence = replace(evidence, likeness=likeness, covered=covered)
    frame.mark("verify")
    return best, fit, evidence, alternatives(poses, fit.q, fit.t)


def _overlap(a: Box, b: Box) -> float:
    """Area two boxes share over that of the smaller one."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    least = min((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in (a, b))
    return max(wide, 0) * max(high, 0) / max(least, 1)


def _finish(craft: Craft, frame: Frame, close: Canvas, start: PhotoFit) -> End:
    """A pose aligned to the end, with the shadows the craft casts on itself."""
    canvas = make_canvas(craft, frame, craft_box(craft, start.q, start.t), FINAL_PX)
    # drawn as large as it is only once it is there: from afar what is thin and bright attracts more as it was
    exact = replace(canvas, clipped=frame.clipped, exact=True)
    faces, camera = faces_of(craft), craft.camera.pinhole
    best = None
    blurs: Tuple[float, ...] = FINAL_BLURS
    before, began = start, 0.0
    for _ in range(ROUNDS):
        here = shadowed(craft, faces, close, before.q, before.t)
        began = here.score if best is None else began
        near = _stepped(craft, canvas, before, here.sun, blurs)
        fit = _stepped(craft, exact, near, here.sun, LAST_BLURS)
        score = photo_score(fit.q, fit.t, faces, close, camera, here.sun)
        if best is not None and score < best.score - NO_WORSE:
            break
        best = End(fit, score, here.sun, began)
        moved = quat.angle_rad(before.q, fit.q)
        # shadows fall as they did where it began
        if moved < MOVED_RAD:
            break
        before, blurs = fit, FINAL_BLURS if moved > FAR_RAD else NEAR_BLURS
    assert best is not None  # noqa: S101 - the first round always ends somewhere
    return best


def _stepped(
    craft: Craft, canvas: Canvas, fit: PhotoFit, sun: Optional[Sunlight], blurs: Tuple[float, ...]
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
