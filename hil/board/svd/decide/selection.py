"""The choice between poses by the whole picture: each draws the craft, and the best drawing wins."""

from __future__ import annotations

from typing import List

import numpy as np

from hil.board.svd.decide.confidence import least_margin
from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.geometry.image_patch import ImagePatch
from hil.board.svd.hypotheses.ambiguity import DISTINCT_RAD
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.observation import Observation
from hil.board.svd.model.image_patch import Box, craft_box, make_canvas, pinhole_box
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.propose.edge_search import MARGIN, twins
from hil.board.svd.refine.final import Choice, End, conclude, finish
from hil.board.svd.refine.parallel import (
    SPREAD_RAD,
    Left,
    Ranked,
    align_together,
    apart,
    begin,
    laid_over,
    leaning,
    led,
    spread_out,
    with_shadows,
)

Array = np.ndarray

# Candidates of a region looked at at first and where those did not settle it, and poses compared of them. Before empty
# space eight of a learned proposal's sixteen led as far as all; before the Earth three of 266 development frames were
# lost.
LOOKED_AT, TEXTURED_LOOKED_AT, ALL_LOOKED_AT, LEADERS = 8, 16, 24, 4

# The same where those did not settle it, with how many go to the end: all that were found.
ALL_LEADERS, ALL_FINALISTS, ALL_FINALS, ALL_FINAL_LEAD = 4, 7, 3, 0.75

# So many of a region are looked at with shadows, of those that its own edges propose so many at all; how much of a
# pose another one covers at the same place.
LIT, LIT_OF_EDGES, SAME_PLACE = 8, 8, 0.5

# What a unit of the learned proposal's log-likelihood counts against the score.
LIKELY_WEIGHT = 0.01

# How many are compared close up with the winner, and with what share of its score a twin is looked at again.
FINALISTS, TWIN_SHARE = 3, 0.6

# How many go to the end, and with what share of the best score.
FINALS, FINAL_LEAD = 2, 0.85

# Rivals that are followed to their ends as well where they seem to explain as much as the winner.
TIES = 2

# Score from which no other near pose is asked.
SURE_SCORE = 0.27

# Longest side of the pictures they are compared on, far and close up [px]; the blurs of each.
FIRST_PX, FIRST_BLURS = 72, (2.0, 2.0, 1.2, 1.2)
# Against a texture clutter outweighs what few pixels of the craft can say.
TEXTURED_PX, TEXTURED_BLURS = 120, (2.0, 1.2, 1.2, 0.8)
SMALL_PX, SMALL_BLURS = 120, (1.2, 0.6)
# Who goes on with each step: share of the best score, and least distance from a better one [rad]. On 128 development
# frames the pose that won was best after one step far off, or had 0.93 of it; at once close up 0.88. Of poses within
# these angles the better one ended as near to the truth as the others.
FIRST_LEFT = (Left(-9.0, 0.0), Left(0.75, 0.05), Left(0.8, 0.1), Left(0.85, 0.1))
SMALL_LEFT = (Left(0.65, 0.07), Left(0.85, 0.07))

# Poses that lean to another side start far off: the tilt of what is nearly flat has near minima.
LEANING_BLURS = (2.0, 2.0, 2.0, 1.2, 0.6)
LEANING_LEFT = (Left(-9.0, 0.0), Left(-9.0, 0.03), Left(-9.0, 0.05), *SMALL_LEFT)

# The same where an end is only checked, and how far from it another one must be [rad].
CHECK_BLURS, CHECK_LEFT = (
    (2.0, 2.0, 1.2, 0.6),
    (Left(-9.0, 0.0), Left(-9.0, 0.03), Left(0.5, 0.05), Left(0.6, 0.07)),
)
CHECK_RAD = float(np.radians(3.0))

# Margin round a place of the learned proposal, which holds all of the craft.
LEARNED_MARGIN = 0.1


def align_leaders(
    craft: PreparedTarget, frame: Observation, found: List[Candidate], keep: int, *, shadows: bool = False
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
        looked = region.source == "learned"
        own = [c for c in found if c.region == region]
        margin = LEARNED_MARGIN if looked else MARGIN
        height, width = frame.image.shape
        textured = looked and frame.background < 0
        first = TEXTURED_LOOKED_AT if textured else LOOKED_AT
        own = own[: LIT_OF_EDGES if not looked else ALL_LOOKED_AT if shadows else first]
        longest, blurs = (TEXTURED_PX, TEXTURED_BLURS) if textured else (FIRST_PX, FIRST_BLURS)
        box = pinhole_box(craft.camera, region.grown(margin, width, height))
        small = make_canvas(craft, frame, box, longest)
        # edges of a place that was looked at are asked after its poses were: these are not drawn again
        known = frame.drawn.pop((box, longest), {}) if looked else None
        if known is not None and not shadows:
            # nobody comes back a third time: what the second leaves would only fill memory
            frame.drawn[box, longest] = known
        courses = [begin(craft, small, c, known) for c in own]
        courses.sort(key=lambda c: -c.score - LIKELY_WEIGHT * c.start.likely)
        if shadows:
            courses = [with_shadows(craft, small, c, known) for c in courses[:LIT]]
            courses.sort(key=lambda c: -c.score - LIKELY_WEIGHT * c.start.likely)
        courses = spread_out(courses, keep)
        if not shadows:
            courses = [with_shadows(craft, small, c, known) for c in courses]
        ranked += align_together(craft, small, courses, blurs, FIRST_LEFT, known)
    frame.count("judged", len(ranked))
    frame.mark("picture")
    return sorted(ranked, key=lambda r: -r.score)


def choose_by_picture(
    craft: PreparedTarget, frame: Observation, leaders: List[Ranked], *, thorough: bool = False
) -> Choice:
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
    # a leader that is not compared here says nothing of its twin
    around = [
        begin(craft, close, twin)
        for twin in _twins(craft, close, c)
        if all(quat.angle_rad(twin.q, o.q) > SPREAD_RAD for o in (c, *others))
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
        ranked.sort(key=lambda r: -r.score)
        ranked += _turned(craft, close, ranked[0].candidate())
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
        ends.append(finish(craft, frame, close, r.fit, r.seen))
    frame.mark("refine")
    choice = conclude(craft, frame, close, ranked, starts, ends, sought=thorough)
    # a tie is one between ends: a rival on its way may lead to the winner, or fall behind
    for _ in range(TIES):
        if choice.rival is None or choice.evidence.margin >= least_margin(choice.evidence):
            break
        if led(choice.rival, starts):  # it is where it leads already
            break
        starts.append(choice.rival)
        ends.append(finish(craft, frame, close, choice.rival.fit, choice.rival.seen))
        frame.mark("refine")
        choice = conclude(craft, frame, close, ranked, starts, ends, sought=thorough)
    return choice


def _twins(craft: PreparedTarget, close: ImagePatch, c: Candidate) -> List[Candidate]:
    """Poses that a pose could be mistaken for, where the picture shows the craft."""
    q, t = twins(craft, [c])
    out = [Candidate(q[k], t[k], c.support, c.field, c.region, c.likely) for k in range(len(q))]
    return laid_over(craft, close, out, c)


def _turned(
    craft: PreparedTarget, close: ImagePatch, held: Candidate, *, symmetries: bool = True
) -> List[Ranked]:
    """Twins of a pose near its end, aligned with their shadows; those by near-symmetries only where told to.

    Those of a pose on its way were a few degrees off, which against a texture costs the right one its lead: of ten
    poses that were lost on development frames it explains 0.05 to 0.2 more at its own end.
    """
    asked = _twins(craft, close, held)
    if not symmetries:
        turned = [quat.multiply(held.q, s) for s in craft.model.symmetry_wxyz]
        asked = [c for c in asked if all(quat.angle_rad(c.q, q) > DISTINCT_RAD for q in turned)]
    courses = [with_shadows(craft, close, begin(craft, close, c)) for c in asked]
    return align_together(craft, close, courses, SMALL_BLURS, SMALL_LEFT)


def check_leaning(
    craft: PreparedTarget, frame: Observation, choice: Choice, *, symmetries: bool = True
) -> Choice:
    """A choice again beside poses that lean to every side of its end, the best of them aligned to its end.

    What is nearly flat has near minima of its tilt, 5 to 17 deg apart, and edges and likeness agree with each: on 300
    development frames four of six wrong poses that were accepted lay in one, and the right one explained more.

    Parameters
    ----------
    symmetries : ask its near-symmetries as well. Not where ``check_turned`` has judged them by more than this score,
        which is a coarse picture's and would bring back what that has refused.
    """
    end = choice.end
    held = Candidate(end.fit.q, end.fit.t, choice.best.support, choice.best.field, choice.best.region)
    about = [with_shadows(craft, choice.close, begin(craft, choice.close, c)) for c in leaning(craft, held)]
    ranked = align_together(craft, choice.close, about, CHECK_BLURS, CHECK_LEFT)
    ranked += _turned(craft, choice.close, held, symmetries=symmetries)
    ranked.sort(key=lambda r: -r.score)
    frame.count("judged", len(ranked))
    frame.mark("twins")
    best = ranked[0]
    # what came back to where it leant from says nothing new, and what is on its way is no rival: of 250 poses that
    # these made look doubtful 19 were declined, all of them right
    if quat.angle_rad(best.fit.q, end.fit.q) <= CHECK_RAD or best.score <= FINAL_LEAD * end.score:
        return choice
    starts = [*choice.starts, best]
    ends = [*choice.ends, finish(craft, frame, choice.close, best.fit, best.seen)]
    frame.mark("refine")
    return conclude(craft, frame, choice.close, choice.ranked, starts, ends)


def _overlap(a: Box, b: Box) -> float:
    """Area two boxes share over that of the smaller one."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    least = min((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in (a, b))
    return max(wide, 0) * max(high, 0) / max(least, 1)
