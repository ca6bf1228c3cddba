"""The choice between poses by the whole picture: each draws the craft, and the best drawing wins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple

import cv2
import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.confidence import Evidence
from hil.board.svd.distinct import alternatives, differs
from hil.board.svd.edges import shrink
from hil.board.svd.frame import Alternative, Candidate, Craft, Frame
from hil.board.svd.levels import LOCAL_FACES
from hil.board.svd.photometric import PhotoFit, photo_align, photo_score
from hil.board.svd.score import support
from hil.board.svd.search import MARGIN, twins
from hil.board.svd.shade import Canvas

Array = np.ndarray

# Poses compared: how many, how far behind the first in support, and how far apart [rad].
LEADERS, LEAD, SPREAD_RAD = 8, 0.25, float(np.radians(6.0))

# How many of them are compared close up with the winner and its twins.
FINALISTS = 4

# How many go to the end, and with what share of the best score.
FINALS, FINAL_LEAD = 2, 0.85

# Longest side of the pictures they are compared on, far and close up, and of the one for the final alignment [px];
# its blurs.
FIRST_PX, SMALL_PX, FINAL_PX = 100, 150, 200
FINAL_BLURS = (1.2, 0.6, 0.0, 0.0, 0.0)


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
    faces = craft.model.faces
    assert faces is not None  # noqa: S101 - the caller asked
    height, width = frame.image.shape
    ranked: List[Ranked] = []
    # edges of one region say nothing of another's: each sends its own leaders
    for region in dict.fromkeys(c.region for c in found):
        own = [c for c in found if c.region == region]
        small = make_canvas(frame, region.grown(MARGIN, width, height), FIRST_PX)
        # half by their edges, half by a first look at the whole picture
        looks = [photo_score(c.q, c.t, faces, small, craft.camera) for c in own]
        seen = [own[k] for k in np.argsort(looks)[::-1]]
        leaders = spread_out(own, LEADERS // 2, LEAD)
        leaders = spread_out([*leaders, *seen], LEADERS, np.inf)
        ranked += _judge(craft, small, leaders, (2.0, 1.2))
    judged = len(ranked)
    ranked.sort(key=lambda r: -r.score)
    frame.mark("picture")
    # once more close up: the winner, who came after it, and its near-symmetries, who must have their chance
    c = ranked[0].candidate()
    close = make_canvas(frame, craft_box(craft, c.q, c.t, width, height), SMALL_PX)
    q, t = twins(craft, [c])
    others = [r.candidate() for r in ranked[1:] if r.start.region == c.region][: FINALISTS - 1]
    others += [
        Candidate(q[k], t[k], c.support, c.field, c.region)
        for k in range(len(q))
        if all(quat.angle_rad(q[k], r.fit.q) > SPREAD_RAD for r in ranked)
    ]
    ranked = _judge(craft, close, [c, *others], (1.2, 0.6))
    frame.keep("ranked", ranked)
    frame.count("judged", judged + len(ranked))
    frame.mark("twins")
    first = ranked[0]
    canvas = make_canvas(frame, craft_box(craft, first.fit.q, first.fit.t, width, height), FINAL_PX)
    # near poses may be one and the same, half-way there: the end decides
    ends = [r.candidate() for r in ranked[:FINALS] if r is first or r.score > FINAL_LEAD * first.score]
    first = _judge(craft, canvas, ends, FINAL_BLURS, LOCAL_FACES)[0]
    fit = first.fit
    frame.mark("refine")
    c = first.start
    s = support(fit.q, fit.t, craft.samples, craft.occ, c.field, craft.camera, craft.spacing_m)
    best = Candidate(fit.q, fit.t, s, c.field, c.region)
    poses = [(r.fit.q, r.fit.t, r.score) for r in ranked]
    rival = max((r[2] for r in poses if differs(r[0], r[1], fit.q, fit.t)), default=0.0)
    evidence = picture_evidence(craft, best, fit, first.score, first.score - max(rival, 0.0))
    frame.mark("verify")
    return best, fit, evidence, alternatives(poses, fit.q, fit.t)


def _judge(
    craft: Craft, canvas: Canvas, candidates: List[Candidate], blurs: Tuple[float, ...], local_faces: int = 0
) -> List[Ranked]:
    """Candidates aligned on a canvas and scored by it, the best first."""
    faces = craft.model.faces
    assert faces is not None  # noqa: S101 - the caller asked
    out = []
    for c in candidates:
        fit = photo_align(c.q, c.t, faces, canvas, craft.camera, craft.radius_m, blurs, local_faces)
        out.append(Ranked(photo_score(fit.q, fit.t, faces, canvas, craft.camera), fit, c))
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


def spread_out(pool: List[Candidate], keep: int, lead: float) -> List[Candidate]:
    """The best candidates that differ from each other, none farther behind the first than ``lead``."""
    out: List[Candidate] = []
    for c in pool:
        if c.support.total < pool[0].support.total - lead or len(out) >= keep:
            break
        if all(quat.angle_rad(c.q, o.q) > SPREAD_RAD for o in out):
            out.append(c)
    return out


def make_canvas(frame: Frame, box: Tuple[int, int, int, int], longest_px: int) -> Canvas:
    """A region of the picture for comparison with the drawn craft."""
    gray, factor = shrink(frame.image, *box, longest_px)
    full = 255.0 if frame.image.dtype == np.uint8 else float(frame.image.max())
    plain = (
        frame.background if frame.background >= 0 else cv2.GaussianBlur(gray, (0, 0), 0.06 * max(gray.shape))
    )
    fine = 3 if FIRST_PX < max(gray.shape) < 180 else 2
    return Canvas(gray, frame.noise / factor, float(box[0]), float(box[1]), factor, fine, full, plain)


def craft_box(craft: Craft, q: Array, t: Array, width: int, height: int) -> Tuple[int, int, int, int]:
    """What of the picture a pose covers, with a margin, in whole pixels."""
    p = craft.camera.pixels(craft.model.ends_m @ quat.matrix(q).T + t)
    (x0, y0), (x1, y1) = p.min(axis=0), p.max(axis=0)
    m = 8 + 0.06 * max(x1 - x0, y1 - y0)
    left, top = int(np.clip(x0 - m, 0, width - 32)), int(np.clip(y0 - m, 0, height - 32))
    return left, top, int(np.clip(x1 + m, left + 32, width)), int(np.clip(y1 + m, top + 32, height))
