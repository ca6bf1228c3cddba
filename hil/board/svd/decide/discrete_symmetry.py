"""An end held against its near-symmetries on a finer picture: small parts are all that tells these apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Callable, List, Optional, Tuple

import numpy as np

from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.geometry.image_patch import ImagePatch
from hil.board.svd.hypotheses.ambiguity import DISTINCT_RAD, alternatives
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.observation import Observation
from hil.board.svd.model.face_gains import OPTICS_PX, blurred
from hil.board.svd.model.image_patch import craft_box, make_canvas
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.refine.final import Choice, End, conclude, finish, same_end
from hil.board.svd.refine.parallel import Ranked, faces_of
from hil.board.svd.refine.photometric import PhotoFit
from hil.board.svd.refine.shadows import Shadowed, shadowed, sharpened

Array = np.ndarray

# Longest side of the picture they are compared on [px], and of the craft's picture from the Sun.
TURNED_PX, SUN_PX = 350, 480

# Pixels speak in which two drawings differ by so many sigma; what the drawing itself is wrong by, share of the light;
# on pictures blurred so [px].
DIFFERENT, WRONG_BY, BLURS = 3.0, 0.3, (1.0, 2.0)

# What speaks for an end and against another, as logarithms of a likelihood: so much for a whole score, a preference of
# one, and each unit of what the learned proposal says, which is never surer than this. A logistic fit on 185 pairs of
# ends of Soyuz, Tianzhou and Chang'e-6 (seed 9310): score, preference and learned proposal are right in 70, 85 and 66 %
# alone. On the half of the frames that it was not fitted on they are right in 89 % together; a finer picture's score
# and the squares of what is left over, asked before, in 84 %.
SCORE_WEIGHT, PREFERENCE_WEIGHT, LEARNED_WEIGHT, SUREST_LEARNED = 12.0, 2.5, 1.4, 4.0

# What of that is as good as a margin of a whole score: a lead of 2.5 is what is asked for. Half of the pairs that were
# not fitted on have it, one in 44 of these wrong; 41 % had the three that were asked for before, one in 16 wrong.
MARGIN_OF_LIKELIHOOD = 1.0 / 25.0

# The learned proposal's logarithm of the likelihood of an attitude q at a place t, see LearnedProposer.log_likelihood.
Prior = Callable[[Array, Array], float]


@dataclass(frozen=True, eq=False)
class Turned:
    """An end, or one turned by a near-symmetry.

    Parameters
    ----------
    drawn : it on the finer picture. looked : log-likelihood by the learned proposal; zero where there is none.
    """

    start: Ranked
    end: End
    drawn: Shadowed
    looked: float


def check_turned(
    craft: PreparedTarget, frame: Observation, choice: Choice, prior: Optional[Prior] = None
) -> Choice:
    """A choice again beside its end turned by each near-symmetry of the craft, all aligned to their ends.

    Three witnesses are heard. The score of either end. The pixels of a finer picture in which two drawings differ: of a
    craft of 15 m a dish and a few sensors, a hundredth of the score. And the learned proposal, which has seen every
    such part in every light.
    """
    symmetries = craft.model.symmetry_wxyz
    if not len(symmetries):
        return choice
    end, c = choice.end, choice.best
    won = max(range(len(choice.ends)), key=lambda k: choice.ends[k].score)
    starts, ends = [choice.starts[won]], [end]
    for s in symmetries:
        q = quat.normalise(quat.multiply(end.fit.q, s))
        there = PhotoFit(q, end.fit.t, end.fit.cost, end.fit.covariance)
        starts.append(
            Ranked(end.score, there, Candidate(q, end.fit.t, c.support, c.field, c.region, c.likely))
        )
        ends.append(finish(craft, frame, choice.close, there))
    frame.mark("refine")
    canvas = replace(
        make_canvas(craft, frame, _box(craft, ends), TURNED_PX), clipped=frame.clipped, exact=True
    )
    held = [_held(craft, canvas, s, e, prior) for s, e in zip(starts, ends)]  # noqa: B905 - Python 3.9
    leads = _leads(held, canvas)
    k = int(leads.argmax())
    best, clear = held[k], float(leads[k])
    q, t = best.end.fit.q, best.end.fit.t
    # what is one of these was judged here
    twins = [quat.multiply(q, s) for s in symmetries]
    others = [r for r in choice.ranked if all(quat.angle_rad(r.fit.q, w) > DISTINCT_RAD for w in twins)]
    new = conclude(craft, frame, choice.close, others, [best.start], [best.end])
    behind = clear * max(best.end.score, 0.0) * MARGIN_OF_LIKELIHOOD
    # ends of before, of another turn about the axis say, are answers still
    rivals = [
        best.end.score - e.score
        for e in choice.ends
        if not same_end(e.fit, best.end.fit) and all(quat.angle_rad(e.fit.q, w) > DISTINCT_RAD for w in twins)
    ]
    evidence = replace(new.evidence, margin=min([new.evidence.margin, behind, *rivals]))
    poses = [(r.fit.q, r.fit.t, r.score) for r in others]
    poses += [(h.end.fit.q, h.end.fit.t, h.end.score) for h in held if h is not best]
    frame.count("turned", len(held))
    frame.mark("verify")
    return replace(new, evidence=evidence, alternatives=alternatives(poses, q, t))


def _leads(held: List[Turned], canvas: ImagePatch) -> Array:
    """(N,) by how much each end is likelier than the likeliest other one [log]; two at least."""
    most = max([1e-6, *(h.end.score for h in held)])
    alone = [
        SCORE_WEIGHT * h.end.score / most + LEARNED_WEIGHT * max(h.looked, -SUREST_LEARNED) for h in held
    ]
    leads = np.full((len(held), len(held)), np.inf)
    for i, a in enumerate(held):
        for j, b in enumerate(held[:i]):
            lead = alone[i] - alone[j] + PREFERENCE_WEIGHT * preference(a.drawn, b.drawn, canvas)
            leads[i, j], leads[j, i] = lead, -lead
    return np.asarray(leads.min(axis=1))


def preference(best: Shadowed, other: Shadowed, canvas: ImagePatch) -> float:
    """How clearly a picture is the one drawing and not the other, -1 to 1: by the pixels in which they differ.

    It is how far from the middle of the two the picture lies along what they differ by, as a matched filter finds it:
    what both leave unexplained, most of what is left over, says nothing.
    """
    a, b = (
        canvas.response.of(blurred(d.shading.picture, OPTICS_PX / canvas.factor))[0] for d in (best, other)
    )
    out = []
    for blur in BLURS:
        gray, drawn_a, drawn_b = (blurred(p, blur) for p in (canvas.gray, a, b))
        noise = canvas.sigma / (2 * np.sqrt(np.pi) * blur)
        apart = drawn_a - drawn_b
        speaks = np.abs(apart) > DIFFERENT * noise
        weight = 1.0 / (noise**2 + (WRONG_BY * np.maximum(drawn_a, drawn_b)) ** 2)
        along = float(np.sum(((gray - 0.5 * (drawn_a + drawn_b)) * apart * weight)[speaks]))
        out.append(np.clip(2 * along / max(float(np.sum((apart**2 * weight)[speaks])), 1e-9), -1.0, 1.0))
    return float(np.mean(out))


def _box(craft: PreparedTarget, ends: List[End]) -> Tuple[int, int, int, int]:
    boxes = np.array([craft_box(craft, e.fit.q, e.fit.t) for e in ends])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return int(x0), int(y0), int(x1), int(y1)


def _held(
    craft: PreparedTarget, canvas: ImagePatch, start: Ranked, end: End, prior: Optional[Prior]
) -> Turned:
    q, t, faces = end.fit.q, end.fit.t, faces_of(craft)
    drawn = sharpened(craft, faces, canvas, q, t, shadowed(craft, faces, canvas, q, t), SUN_PX)
    return Turned(start, end, drawn, 0.0 if prior is None else prior(q, t))
