"""Check of discrete symmetries.

A refined pose is compared with its near-symmetries on a finer image, where small parts distinguish them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.result import DISTINCT_RAD, alternatives
from flyaround.hil.board.hybrid.decide.selection import Selection, select_by_image
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import Prior
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_formation import blurred
from flyaround.hil.board.hybrid.model.image_patch import Box, cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.final import refine_to_convergence
from flyaround.hil.board.hybrid.refine.shadows import LitView, search_sun, sharpen_shadows

Array = np.ndarray

# Longest side of the patch on which the poses are compared [px], and side of the shadow map [px]. Thin parts are lost
# on smaller ones.
PATCH_PX, SHADOW_MAP_PX = 350, 480

# Minimum difference of two renderings at a pixel that counts [sigma of the noise]; hand-tuned.
MIN_CONTRAST_SIGMA = 3.0

# Rendering error as a share of brightness, and blurs at which renderings are compared [px]; hand-tuned.
MODEL_ERROR, BLURS_PX = 0.3, (1.0, 2.0)

# Weights of score, preference and the network's log-likelihood in the log-likelihood ratio of two poses, and limit of
# the network's log-likelihood. A logistic fit on pairs of poses of Soyuz, Tianzhou and Chang'e-6 (seed 9310).
SCORE_WEIGHT, PREFERENCE_WEIGHT, PRIOR_WEIGHT, MAX_PRIOR = 12.0, 2.5, 1.4, 4.0

# Score margin per unit of log-likelihood ratio: acceptance needs a ratio of 2.5 (held-out half of the same pairs).
MARGIN_PER_LOG_LIKELIHOOD = 1.0 / 25.0


@dataclass(frozen=True, eq=False)
class SymmetricPose:
    """A refined pose, or one of its near-symmetries.

    Parameters
    ----------
    optimum : Hypothesis
        Refined pose.
    drawn : LitView
        Rendering of the pose on the finer patch.
    log_prior : float
        Log-likelihood of the pose by the network; zero without a network.
    """

    optimum: Hypothesis
    drawn: LitView
    log_prior: float


def check_discrete_symmetry(
    target: PreparedTarget, frame: Observation, selection: Selection, prior: Optional[Prior] = None
) -> Selection:
    """Compare a selected pose with its rotations by each near-symmetry, all refined, and return the most likely one.

    The evidence combines the score of each pose, the pixels of a finer patch in which the renderings differ (an antenna
    or sensors make up a hundredth of the score), and the network's log-likelihood.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    selection : Selection
        Selection to check.
    prior : callable, optional
        Log-likelihood of a pose by the network.
    """
    symmetries = target.model.symmetry_wxyz
    optimum, patch = selection.best, selection.close
    optima = [optimum]
    for s in symmetries:
        q = quat.normalise(quat.multiply(optimum.q, s))
        start = Hypothesis(replace(optimum.pose, q=q), optimum.source, optimum.score, optimum.support)
        optima.append(refine_to_convergence(target, frame, patch, start))
    finer = replace(
        cut_patch(target, frame, _box(target, optima), PATCH_PX), clipped=frame.clipped, exact=True
    )
    candidates = [_render(target, finer, e, prior) for e in optima]
    log_ratios = _log_ratios(candidates, finer)
    k = int(log_ratios.argmax())
    best, best_log_ratio = candidates[k].optimum, float(log_ratios[k])
    # near-symmetries of the best pose were compared above and are no competitors
    symmetric_q = [quat.multiply(best.q, s) for s in symmetries]
    others = [h for h in selection.ranked if all(quat.angle_rad(h.q, w) > DISTINCT_RAD for w in symmetric_q)]
    new = select_by_image(target, patch, others, best)
    likelihood_margin = best_log_ratio * max(best.score, 0.0) * MARGIN_PER_LOG_LIKELIHOOD
    evidence = replace(new.evidence, margin=min(new.evidence.margin, likelihood_margin))
    poses = [(h.q, h.t, h.score) for h in (*others, *(e for e in optima if e is not best))]
    frame.count("turned", len(candidates))
    return replace(new, evidence=evidence, alternatives=alternatives(poses, best.q, best.t))


def _log_ratios(candidates: List[SymmetricPose], patch: ImagePatch) -> Array:
    """Return the log-likelihood ratio (N,) of each pose to the most likely of the others; at least two poses."""
    best_score = max([1e-6, *(w.optimum.score for w in candidates)])
    single = [
        SCORE_WEIGHT * w.optimum.score / best_score + PRIOR_WEIGHT * max(w.log_prior, -MAX_PRIOR)
        for w in candidates
    ]
    log_ratios = np.full((len(candidates), len(candidates)), np.inf)
    for i, a in enumerate(candidates):
        for j, b in enumerate(candidates[:i]):
            log_ratio = single[i] - single[j] + PREFERENCE_WEIGHT * preference(a.drawn, b.drawn, patch)
            log_ratios[i, j], log_ratios[j, i] = log_ratio, -log_ratio
    return np.asarray(log_ratios.min(axis=1))


def preference(best: LitView, other: LitView, patch: ImagePatch) -> float:
    """Return how clearly the image prefers one rendering to another, -1 to 1, from the pixels in which they differ.

    It is a matched filter: position of the image between the two renderings along their difference. Residuals common to
    both cancel.
    """
    a, b = (patch.response.mean(blurred(d.shading.picture, OPTICS_PX / patch.factor)) for d in (best, other))
    out = []
    for blur in BLURS_PX:
        gray, drawn_a, drawn_b = (blurred(p, blur) for p in (patch.gray, a, b))
        noise = patch.sigma / (2 * np.sqrt(np.pi) * blur)
        difference = drawn_a - drawn_b
        differs = np.abs(difference) > MIN_CONTRAST_SIGMA * noise
        weight = 1.0 / (noise**2 + (MODEL_ERROR * np.maximum(drawn_a, drawn_b)) ** 2)
        along = float(np.sum(((gray - 0.5 * (drawn_a + drawn_b)) * difference * weight)[differs]))
        out.append(
            np.clip(2 * along / max(float(np.sum((difference**2 * weight)[differs])), 1e-9), -1.0, 1.0)
        )
    return float(np.mean(out))


def _box(target: PreparedTarget, optima: List[Hypothesis]) -> Box:
    """Return the box that encloses the target at every pose."""
    boxes = np.array([target_box(target, e.q, e.t) for e in optima])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return int(x0), int(y0), int(x1), int(y1)


def _render(
    target: PreparedTarget, patch: ImagePatch, optimum: Hypothesis, prior: Optional[Prior]
) -> SymmetricPose:
    """Return a pose rendered on a finer patch with sharp shadows."""
    q, t = optimum.q, optimum.t
    view = sharpen_shadows(target, patch, q, t, search_sun(target, patch, q, t), SHADOW_MAP_PX)
    return SymmetricPose(optimum, view, 0.0 if prior is None else float(prior(q[None], t[None])[0]))
