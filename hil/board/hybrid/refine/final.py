"""Final alignment: a hypothesis refined to convergence on the image, with cast shadows."""

from __future__ import annotations

from dataclasses import replace
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine.photometric import JOINT_AT_END, explained, photo_draw, photo_step
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# A pose that moved by more is aligned again [rad], at most ROUNDS times. A score lower by more than the third is
# worse; by more than the fourth, the alignment diverges.
MOVED_RAD, ROUNDS, NO_WORSE, ASTRAY = float(np.radians(0.5)), 6, 0.003, 0.02

# Longest side of the patch for the final alignment [px], and the last blurs.
FINAL_PX, LAST_BLURS = 230, (0.3, 0.0)

# Blurs before them: share of that size, blurs at first and after a large move, and after a small one. Before empty
# space a smaller patch keeps all that such blurs leave.
EMPTY_WIDE, TEXTURED_WIDE = (0.65, (0.8, 0.5), (0.5,)), (1.0, (1.2, 0.8), (0.8,))

# The same of a round target, of which small parts alone show the turn about the axis.
ROUND_FINAL_PX = 400

# A move by more is large [rad], and these wider blurs come first.
FAR_RAD, FAR_BLURS = float(np.radians(1.0)), (2.0, 1.3)


def refine_to_end(
    target: PreparedTarget, frame: Observation, close: ImagePatch, start: Hypothesis, rounds: int = ROUNDS
) -> Hypothesis:
    """Align a hypothesis until it converges; the ``start`` of the result has its score with fine shadows.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    close : ImagePatch
        Patch that refined poses are scored on.
    start : Hypothesis
        The hypothesis.
    rounds : int
        Most alignments.
    """
    box, longest = target_box(target, start.q, start.t), ROUND_FINAL_PX if target.round else FINAL_PX
    share, at_first, near_by = TEXTURED_WIDE if frame.background < 0 else EMPTY_WIDE
    sharp = cut_patch(target, frame, box, longest)
    wide = cut_patch(target, frame, box, round(share * longest)) if share < 1 else sharp
    # thin parts get their true area only at the end: from afar a thin bright part attracts more without
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    faces, camera = faces_of(target), target.camera.pinhole
    best: Optional[Hypothesis] = None
    blurs: Tuple[float, ...] = at_first
    before = start.pose
    here = search_sun(target, close, before.q, before.t, seen=start.seen)
    began, sun = start.without_view(here.score), here.sun
    for _ in range(rounds):
        near = _stepped(target, wide, before, sun, blurs)
        pose = _stepped(target, exact, near, sun, LAST_BLURS)
        view = photo_draw(pose.q, pose.t, faces, close, camera, sun)
        score = explained(view, close)
        if best is None or score > best.score - NO_WORSE:
            best = Hypothesis(pose, start.source, score, start.support, view=view, sun=sun, start=began)
        elif score < best.score - ASTRAY:
            break
        moved = quat.angle_rad(before.q, pose.q)
        if moved < MOVED_RAD:
            break
        before = pose
        blurs = near_by
        if moved > FAR_RAD:
            # after a large move the shadows have moved; after a small one the same Sun is still right
            sun = search_sun(target, close, before.q, before.t, seen=view.seen).sun
            blurs = (*FAR_BLURS, *at_first)
    assert best is not None  # noqa: S101 - the first round always ends somewhere
    return best


def _stepped(
    target: PreparedTarget,
    patch: ImagePatch,
    pose: PoseFit,
    sun: Optional[ShadowMap],
    blurs: Tuple[float, ...],
) -> PoseFit:
    """Return the pose after some steps, each with the brightness of many groups."""
    faces, camera = faces_of(target), target.camera.pinhole
    for blur in blurs:
        view = photo_draw(pose.q, pose.t, faces, patch, camera, sun)
        step = photo_step(pose, view, faces, patch, camera, target.radius_m, blur, joint=JOINT_AT_END)
        if step is None:
            break
        pose = step
    return pose
