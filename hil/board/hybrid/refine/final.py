"""Final alignment: a hypothesis refined to its end on the image, with the shadows the target casts on itself."""

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

# An end that moved by more is aligned again, with shadows as they fall there, so many times in all [rad]: most are
# there after one, a few are 10 deg away at first. A score lower by more is a worse one; by far more, it leads away.
MOVED_RAD, ROUNDS, NO_WORSE, ASTRAY = float(np.radians(0.5)), 6, 0.003, 0.02

# Longest side of the picture for the final alignment [px], and the last blurs.
FINAL_PX, LAST_BLURS = 230, (0.3, 0.0)

# Those before them: share of that size, at first and after an end that moved far, and after one that did not. A smaller
# picture shows all that such blurs leave; before a texture of 105 development frames four fewer were fine with it.
EMPTY_WIDE, TEXTURED_WIDE = (0.65, (0.8, 0.5), (0.5,)), (1.0, (1.2, 0.8), (0.8,))

# The same of a round target: its turn about the axis is told by small parts alone.
ROUND_FINAL_PX = 400

# An end that moved by more is far off [rad], and what is wider still comes first.
FAR_RAD, FAR_BLURS = float(np.radians(1.0)), (2.0, 1.3)


def refine_to_end(
    target: PreparedTarget, frame: Observation, close: ImagePatch, start: Hypothesis, rounds: int = ROUNDS
) -> Hypothesis:
    """A hypothesis aligned to its end; its ``start`` has the score that it has with fine shadows.

    Parameters
    ----------
    close : patch that ends are scored on. start : with the faces that ``close`` shows there, where they are drawn.
    rounds : times that an end which moves is aligned, at most.
    """
    box, longest = target_box(target, start.q, start.t), ROUND_FINAL_PX if target.round else FINAL_PX
    share, at_first, near_by = TEXTURED_WIDE if frame.background < 0 else EMPTY_WIDE
    sharp = cut_patch(target, frame, box, longest)
    wide = cut_patch(target, frame, box, round(share * longest)) if share < 1 else sharp
    # drawn as large as it is only once it is there: from afar what is thin and bright attracts more as it was
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    faces, camera = faces_of(target), target.camera.pinhole
    best: Optional[Hypothesis] = None
    blurs: Tuple[float, ...] = at_first
    before = start.pose
    here = search_sun(target, faces, close, before.q, before.t, seen=start.seen)
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
            # shadows fall elsewhere by now; of a Sun found from nearby they are where they were
            sun = search_sun(target, faces, close, before.q, before.t, seen=view.seen).sun
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
    """The pose some steps on, with many face gains found beside it."""
    faces, camera = faces_of(target), target.camera.pinhole
    for blur in blurs:
        view = photo_draw(pose.q, pose.t, faces, patch, camera, sun)
        step = photo_step(pose, view, faces, patch, camera, target.radius_m, blur, joint=JOINT_AT_END)
        if step is None:
            break
        pose = step
    return pose
