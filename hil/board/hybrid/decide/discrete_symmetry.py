"""Check of discrete symmetries: an end against its near-symmetries on a finer image; small parts tell them apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Callable, List, Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.result import DISTINCT_RAD, alternatives
from flyaround.hil.board.hybrid.decide.selection import Selection, select
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import same_end
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_patch import Box, cut_patch, target_box
from flyaround.hil.board.hybrid.model.many_groups import blurred
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.final import refine_to_end
from flyaround.hil.board.hybrid.refine.shadows import LitView, search_sun, sharpen_shadows

Array = np.ndarray

# Longest side of the picture they are compared on [px], and of the target's picture from the Sun.
TWINS_PX, SUN_PX = 350, 480

# Pixels speak in which two drawings differ by so many sigma; what the drawing itself is wrong by, share of the light;
# on pictures blurred so [px].
DIFFERENT, WRONG_BY, BLURS = 3.0, 0.3, (1.0, 2.0)

# What speaks for an end and against another, as logarithms of a likelihood: so much for a whole score, a preference of
# one, and each unit of what the learned proposal says, which is never surer than this. A logistic fit on 185 pairs of
# ends of Soyuz, Tianzhou and Chang'e-6 (seed 9310): score, preference and proposal are right in 70, 85 and 66 % alone.
# On the half of the frames that it was not fitted on they are right in 89 % together; a finer picture's score and the
# squares of what is left over, asked before, in 84 %.
SCORE_WEIGHT, PREFERENCE_WEIGHT, PRIOR_WEIGHT, SUREST_PRIOR = 12.0, 2.5, 1.4, 4.0

# What of that is as good as a margin of a whole score: a lead of 2.5 is what is asked for. Half of the pairs that were
# not fitted on have it, one in 44 of these wrong; 41 % had the three that were asked for before, one in 16 wrong.
MARGIN_OF_LIKELIHOOD = 1.0 / 25.0

# The learned proposal's logarithm of the likelihood of an attitude q at a place t, see LearnedProposer.log_likelihood.
Prior = Callable[[Array, Array], float]


@dataclass(frozen=True, eq=False)
class TurnedEnd:
    """An end, or one turned by a near-symmetry.

    Parameters
    ----------
    drawn : it on the finer picture. log_prior : logarithm of its likelihood by the learned proposal, else zero.
    """

    end: Hypothesis
    drawn: LitView
    log_prior: float


def check_discrete_symmetry(
    target: PreparedTarget, frame: Observation, selection: Selection, prior: Optional[Prior] = None
) -> Selection:
    """A selection again beside its end turned by each near-symmetry of the target, all refined to their ends.

    Three witnesses are heard. The score of either end. The pixels of a finer picture in which two drawings differ: of a
    target of 15 m a dish and a few sensors, a hundredth of the score. And the learned proposal, which has seen every
    such part in every light.
    """
    symmetries = target.model.symmetry_wxyz
    end, patch = selection.best, selection.close
    ends = [end]
    for s in symmetries:
        q = quat.normalise(quat.multiply(end.q, s))
        start = Hypothesis(replace(end.pose, q=q), end.source, end.score, end.support)
        ends.append(refine_to_end(target, frame, patch, start))
    finer = replace(cut_patch(target, frame, _box(target, ends), TWINS_PX), clipped=frame.clipped, exact=True)
    twins = [_drawn(target, finer, e, prior) for e in ends]
    leads = _leads(twins, finer)
    k = int(leads.argmax())
    best, clear = twins[k].end, float(leads[k])
    # what is one of these was judged here
    turned = [quat.multiply(best.q, s) for s in symmetries]
    others = [h for h in selection.ranked if all(quat.angle_rad(h.q, w) > DISTINCT_RAD for w in turned)]
    new = select(target, patch, others, [best])
    behind = clear * max(best.score, 0.0) * MARGIN_OF_LIKELIHOOD
    # ends of before, of another turn about the axis say, are answers still
    rivals = [
        best.score - e.score
        for e in selection.ends
        if not same_end(e.pose, best.pose) and all(quat.angle_rad(e.q, w) > DISTINCT_RAD for w in turned)
    ]
    evidence = replace(new.evidence, margin=min([new.evidence.margin, behind, *rivals]))
    poses = [(h.q, h.t, h.score) for h in (*others, *(e for e in ends if e is not best))]
    frame.count("turned", len(twins))
    return replace(new, evidence=evidence, alternatives=alternatives(poses, best.q, best.t))


def _leads(twins: List[TurnedEnd], patch: ImagePatch) -> Array:
    """(N,) by how much each end is likelier than the likeliest other one [log]; two at least."""
    most = max([1e-6, *(w.end.score for w in twins)])
    alone = [
        SCORE_WEIGHT * w.end.score / most + PRIOR_WEIGHT * max(w.log_prior, -SUREST_PRIOR) for w in twins
    ]
    leads = np.full((len(twins), len(twins)), np.inf)
    for i, a in enumerate(twins):
        for j, b in enumerate(twins[:i]):
            lead = alone[i] - alone[j] + PREFERENCE_WEIGHT * preference(a.drawn, b.drawn, patch)
            leads[i, j], leads[j, i] = lead, -lead
    return np.asarray(leads.min(axis=1))


def preference(best: LitView, other: LitView, patch: ImagePatch) -> float:
    """How clearly a picture is the one drawing and not the other, -1 to 1: by the pixels in which they differ.

    It is how far from the middle of the two the picture lies along what they differ by, as a matched filter finds it:
    what both leave unexplained, most of what is left over, says nothing.
    """
    a, b = (patch.response.of(blurred(d.shading.picture, OPTICS_PX / patch.factor))[0] for d in (best, other))
    out = []
    for blur in BLURS:
        gray, drawn_a, drawn_b = (blurred(p, blur) for p in (patch.gray, a, b))
        noise = patch.sigma / (2 * np.sqrt(np.pi) * blur)
        apart = drawn_a - drawn_b
        speaks = np.abs(apart) > DIFFERENT * noise
        weight = 1.0 / (noise**2 + (WRONG_BY * np.maximum(drawn_a, drawn_b)) ** 2)
        along = float(np.sum(((gray - 0.5 * (drawn_a + drawn_b)) * apart * weight)[speaks]))
        out.append(np.clip(2 * along / max(float(np.sum((apart**2 * weight)[speaks])), 1e-9), -1.0, 1.0))
    return float(np.mean(out))


def _box(target: PreparedTarget, ends: List[Hypothesis]) -> Box:
    """The box that holds the target at every end."""
    boxes = np.array([target_box(target, e.q, e.t) for e in ends])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return int(x0), int(y0), int(x1), int(y1)


def _drawn(target: PreparedTarget, patch: ImagePatch, end: Hypothesis, prior: Optional[Prior]) -> TurnedEnd:
    """An end drawn on a finer patch with sharp shadows."""
    q, t, faces = end.q, end.t, faces_of(target)
    view = sharpen_shadows(target, faces, patch, q, t, search_sun(target, faces, patch, q, t), SUN_PX)
    return TurnedEnd(end, view, 0.0 if prior is None else prior(q, t))
