"""Final alignment: a hypothesis refined to convergence on the image, with cast shadows.

Values without a source are hand-tuned on development frames (docs/lab/2026-11-estimator.md).
"""

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
from flyaround.hil.board.hybrid.refine.photometric import (
    FINAL_JOINT_GROUPS,
    explained,
    photo_draw,
    photo_step,
)
from flyaround.hil.board.hybrid.refine.shadows import search_sun

# Change of attitude below which an alignment has converged [rad], and maximum number of alignments.
CONVERGED_RAD, MAX_ROUNDS = float(np.radians(0.5)), 3

# Decrease of the score above which a pose is worse, and above which the alignment has diverged.
SCORE_TOLERANCE, DIVERGENCE_DECREASE = 0.003, 0.02

# Longest side of the patch for the final alignment [px], and the last blurs.
FINAL_PX, LAST_BLURS = 230, (0.3, 0.0)

# First blurs: size of their patch as a share of the final patch, blurs at the start and after a large change, and blurs
# after a small change. In front of empty space a smaller patch loses nothing at these blurs.
EMPTY_WIDE, TEXTURED_WIDE = (0.65, (0.8, 0.5), (0.5,)), (1.0, (1.2, 0.8), (0.8,))

# Longest side for a round target, whose roll angle is visible in small parts only.
ROUND_FINAL_PX = 400

# Change of attitude from which a change is large [rad], and the wider blurs that come first after it.
FAR_RAD, FAR_BLURS = float(np.radians(1.0)), (2.0, 1.3)


def refine_to_convergence(
    target: PreparedTarget, frame: Observation, close: ImagePatch, start: Hypothesis
) -> Hypothesis:
    """Align a hypothesis until it converges.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    close : ImagePatch
        Patch on which refined poses are scored.
    start : Hypothesis
        Hypothesis to align.

    Returns
    -------
    Hypothesis
        Aligned hypothesis with its rendering. Its ``start`` is the given hypothesis with the score of its pose under
        fine shadows, without a rendering.
    """
    box, longest = target_box(target, start.q, start.t), ROUND_FINAL_PX if target.round else FINAL_PX
    share, first_blurs, later_blurs = TEXTURED_WIDE if frame.background < 0 else EMPTY_WIDE
    sharp = cut_patch(target, frame, box, longest)
    wide = cut_patch(target, frame, box, round(share * longest)) if share < 1 else sharp
    # thin parts get their exact area only at the end: a thin bright part rendered too wide attracts distant poses
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    faces, camera = faces_of(target), target.camera.pinhole
    best: Optional[Hypothesis] = None
    blurs: Tuple[float, ...] = first_blurs
    previous = start.pose
    initial = search_sun(target, close, previous.q, previous.t, visible_face=start.visible_face)
    origin, sun = start.without_view(initial.score), initial.sun
    for _ in range(MAX_ROUNDS):
        near = _align(target, wide, previous, sun, blurs)
        pose = _align(target, exact, near, sun, LAST_BLURS)
        view = photo_draw(pose.q, pose.t, faces, close, camera, sun)
        score = explained(view, close)
        if best is None or score > best.score - SCORE_TOLERANCE:
            best = Hypothesis(pose, start.source, score, start.support, view=view, sun=sun, start=origin)
        elif score < best.score - DIVERGENCE_DECREASE:
            break
        change_rad = quat.angle_rad(previous.q, pose.q)
        if change_rad < CONVERGED_RAD:
            break
        previous = pose
        blurs = later_blurs
        if change_rad > FAR_RAD:
            # after a large change the shadows have moved; after a small one the same Sun is still right
            sun = search_sun(target, close, previous.q, previous.t, visible_face=view.visible_face).sun
            blurs = (*FAR_BLURS, *first_blurs)
    assert best is not None  # noqa: S101 - there is at least one round
    return best


def _align(
    target: PreparedTarget,
    patch: ImagePatch,
    pose: PoseFit,
    sun: Optional[ShadowMap],
    blurs: Tuple[float, ...],
) -> PoseFit:
    """Return the pose after a Gauss-Newton step for each blur."""
    faces, camera = faces_of(target), target.camera.pinhole
    for blur in blurs:
        view = photo_draw(pose.q, pose.t, faces, patch, camera, sun)
        step = photo_step(pose, view, faces, patch, camera, target.radius_m, blur, joint=FINAL_JOINT_GROUPS)
        if step is None:
            break
        pose = step
    return pose
