"""Refines several hypotheses in parallel on one image patch.

Those whose score falls behind are dropped, and those that converge to a better one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.ambiguity import converges_elsewhere
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, drawn
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_step
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# An alignment that leaves the size it started from by more has gone astray: logarithm of the range.
ASTRAY = 0.3

# What of a score is noise where all are low.
SLACK = 0.02

# Hypotheses that were drawn on one patch, by where they were and what was done.
Drawings = Dict[Tuple[Any, ...], Hypothesis]


@dataclass(frozen=True)
class Pruning:
    """Which of the hypotheses that are refined in parallel go on.

    Parameters
    ----------
    share : of the best score that the others must have. apart_rad : how far from every better one they must be.
    most : how many at most.
    """

    share: float
    apart_rad: float
    most: int = 1000

    def split(self, hypotheses: List[Hypothesis]) -> Tuple[List[Hypothesis], List[Hypothesis]]:
        """Those that go on, the best first, and those that stay with their score; near-duplicates are dropped."""
        going: List[Hypothesis] = []
        stay: List[Hypothesis] = []
        for h in sorted(hypotheses, key=lambda h: -h.score):
            if going and (h.score < self.share * going[0].score - SLACK or len(going) >= self.most):
                stay.append(h)
            elif all(converges_elsewhere(h.pose, o.pose, self.apart_rad) for o in going):
                going.append(h)
        return going, stay


def draw(
    target: PreparedTarget, patch: ImagePatch, h: Hypothesis, drawings: Optional[Drawings] = None
) -> Hypothesis:
    """A hypothesis drawn where it is, without shadows, and scored; its refinement starts here."""

    def made() -> Hypothesis:
        view = photo_draw(h.q, h.t, faces_of(target), patch, target.camera.pinhole)
        pose, score = PoseFit(h.q, h.t), explained(view, patch)
        return replace(h, pose=pose, score=score, view=view, seen=None, sun=None, start=h)

    return _memoised(drawings, ("plain", h.q.tobytes(), h.t.tobytes()), h, made)


def draw_shadows(
    target: PreparedTarget, patch: ImagePatch, h: Hypothesis, drawings: Optional[Drawings] = None
) -> Hypothesis:
    """A hypothesis that was drawn, with the shadows that the image wants there."""

    def made() -> Hypothesis:
        lit = search_sun(target, faces_of(target), patch, h.q, h.t, drawn(h), coarse=True)
        return replace(h, view=lit.shading, score=lit.score, sun=lit.sun)

    return _memoised(drawings, ("shadows", h.q.tobytes(), h.t.tobytes()), h.origin, made)


def _memoised(
    drawings: Optional[Drawings], key: Tuple[Any, ...], start: Hypothesis, made: Callable[[], Hypothesis]
) -> Hypothesis:
    """What was drawn for the key before, now of another ``start``; else as it is made."""
    if drawings is None:
        return made()
    if key not in drawings:
        drawings[key] = made()
    return replace(drawings[key], start=start, source=start.source, support=start.support)


def refine_in_parallel(
    target: PreparedTarget,
    patch: ImagePatch,
    hypotheses: List[Hypothesis],
    blurs: Tuple[float, ...],
    prunings: Tuple[Pruning, ...],
    drawings: Optional[Drawings] = None,
) -> List[Hypothesis]:
    """Hypotheses that were drawn, aligned side by side on a patch and scored by it, the best first.

    Parameters
    ----------
    blurs : of each step. prunings : who goes on with it; the others stay where they are, with the score they have.
    drawings : of the same patch from before; receives these.
    """
    done: List[Hypothesis] = []
    for blur, pruning in zip(blurs, prunings):  # noqa: B905 - Python 3.9 has no strict=
        going, stay = pruning.split(hypotheses)
        done += stay
        hypotheses = []
        for h in going:
            key = (h.q.tobytes(), h.t.tobytes(), h.sun, blur)
            on = _memoised(drawings, key, h.origin, partial(_step, target, patch, h, blur))
            moved = on.q.tolist() != h.q.tolist() or on.t.tolist() != h.t.tolist()
            (hypotheses if moved else done).append(on)
    out = []
    for h in (*hypotheses, *done):
        astray = abs(np.log(max(h.t[2], 1e-3) / max(h.origin.t[2], 1e-3))) > ASTRAY
        out.append(h.without_view(0.5 * h.score if astray else h.score))
    return sorted(out, key=lambda h: -h.score)


def _step(target: PreparedTarget, patch: ImagePatch, h: Hypothesis, blur: float) -> Hypothesis:
    """A hypothesis one Gauss-Newton step on; itself where the image says nothing."""
    faces, camera = faces_of(target), target.camera.pinhole
    pose = photo_step(h.pose, drawn(h), faces, patch, camera, target.radius_m, blur)
    if pose is None:
        return h
    view = photo_draw(pose.q, pose.t, faces, patch, camera, h.sun)
    return replace(h, pose=pose, view=view, score=explained(view, patch))
