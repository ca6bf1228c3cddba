"""Parallel refinement of several hypotheses on one image patch.

Hypotheses are dropped if their scores fall behind or if they converge to the same optimum as a better one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Tuple

import numpy as np

from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import converges_elsewhere
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, drawn
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_step
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# Maximum change of the logarithm of the range, beyond which an alignment has diverged; hand-tuned.
MAX_LOG_RANGE_CHANGE = 0.3

# Differences of scores below this are noise: such hypotheses are not pruned; hand-tuned.
SCORE_NOISE = 0.02


@dataclass(frozen=True)
class Pruning:
    """Selection of the hypotheses to refine further.

    Parameters
    ----------
    share : float
        Minimum share of the best score.
    apart_rad : float
        Minimum angle to every better hypothesis [rad].
    """

    share: float
    apart_rad: float

    def split(self, hypotheses: List[Hypothesis]) -> Tuple[List[Hypothesis], List[Hypothesis]]:
        """Return hypotheses to refine, best first, and hypotheses to leave unchanged; duplicates are dropped."""
        active: List[Hypothesis] = []
        inactive: List[Hypothesis] = []
        for h in sorted(hypotheses, key=lambda h: -h.score):
            if active and h.score < self.share * active[0].score - SCORE_NOISE:
                inactive.append(h)
            elif all(converges_elsewhere(h.pose, o.pose, self.apart_rad) for o in active):
                active.append(h)
        return active, inactive


def draw(target: PreparedTarget, patch: ImagePatch, h: Hypothesis) -> Hypothesis:
    """Render a hypothesis without shadows and score it, before its refinement.

    Returns
    -------
    Hypothesis
        Hypothesis with its rendering and the score of the image; its ``start`` is ``h``, and its covariance is the
        default of `PoseFit`.
    """
    view = photo_draw(h.q, h.t, faces_of(target), patch, target.camera.pinhole)
    pose, score = PoseFit(h.q, h.t), explained(view, patch)
    return replace(h, pose=pose, score=score, view=view, visible_face=None, sun=None, start=h)


def draw_shadows(target: PreparedTarget, patch: ImagePatch, h: Hypothesis) -> Hypothesis:
    """Render a hypothesis with the shadows that explain the image best.

    Returns
    -------
    Hypothesis
        Hypothesis at the same pose with the rendering, score and Sun of those shadows; Sun None if no shadows are
        better.
    """
    lit = search_sun(target, patch, h.q, h.t, drawn(h), coarse=True)
    return replace(h, view=lit.shading, score=lit.score, sun=lit.sun)


def refine_in_parallel(
    target: PreparedTarget,
    patch: ImagePatch,
    hypotheses: List[Hypothesis],
    blurs: Tuple[float, ...],
    prunings: Tuple[Pruning, ...],
) -> List[Hypothesis]:
    """Align rendered hypotheses on a patch, and return them with their scores, best first.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Reduced region of the image around the target.
    hypotheses : list of Hypothesis
        Rendered hypotheses.
    blurs : tuple of float
        Blur of each step [patch px].
    prunings : tuple of Pruning
        Pruning before each step; pruned hypotheses keep their pose and score.
    """
    finished: List[Hypothesis] = []
    for blur, pruning in zip(blurs, prunings):  # noqa: B905 - Python 3.9 has no strict=
        active, inactive = pruning.split(hypotheses)
        finished += inactive
        hypotheses = []
        for h in active:
            stepped = _step(target, patch, h, blur)
            moved = stepped.q.tolist() != h.q.tolist() or stepped.t.tolist() != h.t.tolist()
            (hypotheses if moved else finished).append(stepped)
    out = []
    for h in (*hypotheses, *finished):
        # 1 mm keeps the logarithm finite
        diverged = abs(np.log(max(h.t[2], 1e-3) / max(h.origin.t[2], 1e-3))) > MAX_LOG_RANGE_CHANGE
        out.append(h.without_view(0.5 * h.score if diverged else h.score))
    return sorted(out, key=lambda h: -h.score)


def _step(target: PreparedTarget, patch: ImagePatch, h: Hypothesis, blur: float) -> Hypothesis:
    """Return a hypothesis after one Gauss-Newton step, unchanged if the image has no information."""
    faces, camera = faces_of(target), target.camera.pinhole
    pose = photo_step(h.pose, drawn(h), faces, patch, camera, target.radius_m, blur)
    if pose is None:
        return h
    view = photo_draw(pose.q, pose.t, faces, patch, camera, h.sun)
    return replace(h, pose=pose, view=view, score=explained(view, patch))
