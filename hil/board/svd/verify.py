"""The choice between poses by the whole picture: each draws the craft, and the best drawing wins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.confidence import Evidence
from hil.board.svd.distinct import alternatives, differs
from hil.board.svd.edges import shrink
from hil.board.svd.frame import Alternative, Candidate, Craft, Frame
from hil.board.svd.photometric import PhotoFit, photo_align, photo_score
from hil.board.svd.score import support
from hil.board.svd.search import MARGIN, twins
from hil.board.svd.shade import Canvas

Array = np.ndarray

# Poses compared: how many, how far behind the first in support, and how far apart [rad].
LEADERS, LEAD, SPREAD_RAD = 8, 0.25, float(np.radians(6.0))

# Longest side of the picture they are compared on, and of the one for the final alignment [px]; its blurs.
SMALL_PX, FINAL_PX = 150, 240
FINAL_BLURS = (1.2, 0.6, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Ranked:
    """A pose aligned on the picture, its score, and where it started."""

    score: float
    fit: PhotoFit
    start: Candidate


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
    leaders = spread_out(found, LEADERS, LEAD)
    small = make_canvas(frame, _around(leaders, frame.image.shape), SMALL_PX)

    def judge(candidates: List[Candidate]) -> List[Ranked]:
        out = []
        for c in candidates:
            fit = photo_align(c.q, c.t, faces, small, craft.camera, craft.radius_m, (2.0, 1.2))
            out.append(Ranked(photo_score(fit.q, fit.t, faces, small, craft.camera), fit, c))
        return out

    ranked = sorted(judge(leaders), key=lambda r: -r.score)
    frame.mark("picture")
    # the near-symmetries of the winner: the rival must have had its chance
    first = ranked[0]
    c = Candidate(first.fit.q, first.fit.t, first.start.support, first.start.field, first.start.region)
    q, t = twins(craft, [c])
    new = [k for k in range(len(q)) if all(quat.angle_rad(q[k], r.fit.q) > SPREAD_RAD for r in ranked)]
    rivals = judge([Candidate(q[k], t[k], c.support, c.field, c.region) for k in new])
    ranked = sorted(ranked + rivals, key=lambda r: -r.score)
    frame.keep("ranked", ranked)
    frame.count("judged", len(ranked))
    frame.mark("twins")
    first = ranked[0]
    h, w = frame.image.shape
    canvas = make_canvas(frame, craft_box(craft, first.fit.q, first.fit.t, w, h), FINAL_PX)
    fit = photo_align(first.fit.q, first.fit.t, faces, canvas, craft.camera, craft.radius_m, FINAL_BLURS)
    frame.mark("refine")
    c = first.start
    s = support(fit.q, fit.t, craft.samples, craft.occ, c.field, craft.camera, craft.spacing_m)
    best = Candidate(fit.q, fit.t, s, c.field, c.region)
    others = [(r.fit.q, r.fit.t, r.score) for r in ranked]
    rival = max((r[2] for r in others if differs(r[0], r[1], fit.q, fit.t)), default=0.0)
    evidence = picture_evidence(craft, best, fit, first.score, first.score - max(rival, 0.0))
    frame.mark("verify")
    return best, fit, evidence, alternatives(others, fit.q, fit.t)


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


def _around(leaders: List[Candidate], shape: Tuple[int, ...]) -> Tuple[int, int, int, int]:
    """The box of every region that gave a leader."""
    boxes = np.array([c.region.grown(MARGIN, shape[1], shape[0]) for c in leaders])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return int(x0), int(y0), int(x1), int(y1)


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
    plain = frame.background if frame.background >= 0 else float(np.median(gray))
    fine = 3 if max(gray.shape) < 180 else 2
    return Canvas(gray, frame.noise / factor, float(box[0]), float(box[1]), factor, fine, full, plain)


def craft_box(craft: Craft, q: Array, t: Array, width: int, height: int) -> Tuple[int, int, int, int]:
    """What of the picture a pose covers, with a margin, in whole pixels."""
    p = craft.camera.pixels(craft.model.ends_m @ quat.matrix(q).T + t)
    (x0, y0), (x1, y1) = p.min(axis=0), p.max(axis=0)
    m = 8 + 0.06 * max(x1 - x0, y1 - y0)
    left, top = int(np.clip(x0 - m, 0, width - 32)), int(np.clip(y0 - m, 0, height - 32))
    return left, top, int(np.clip(x1 + m, left + 32, width)), int(np.clip(y1 + m, top + 32, height))
