"""Last steps of the selected pose, which remove its dependence on the start of the alignment."""

from __future__ import annotations

from dataclasses import replace
from typing import List, Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine.final import FAR_RAD, FINAL_PX, ROUND_FINAL_PX
from flyaround.hil.board.hybrid.refine.photometric import (
    FINAL_JOINT_GROUPS,
    explained,
    photo_draw,
    photo_shade,
    photo_step,
)

# Minimum gain of the score by shadows, and side of the shadow map [px]. With a smaller gain, rounding decides between
# distant directions of the Sun, and each biases the pose.
MIN_SHADOW_GAIN, SHADOW_MAP_PX = 0.03, 384

# Number of steps on the unblurred image. The answer is their mean, because single steps jump with rendered pixels.
STEPS = 2


def settle(target: PreparedTarget, frame: Observation, close: ImagePatch, optimum: Hypothesis) -> PoseFit:
    """Return the pose of a refined hypothesis after the last steps.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    close : ImagePatch
        Patch on which refined poses were scored.
    optimum : Hypothesis
        Refined hypothesis.
    """
    longest = ROUND_FINAL_PX if target.round else FINAL_PX
    sharp = cut_patch(target, frame, target_box(target, optimum.q, optimum.t), longest)
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    sun = _fine_shadows(target, close, optimum)
    faces, camera = faces_of(target), target.camera.pinhole
    poses = [optimum.pose]
    for _ in range(STEPS):
        pose = poses[-1]
        view = photo_draw(pose.q, pose.t, faces, exact, camera, sun)
        step = photo_step(
            pose, view, faces, exact, camera, target.radius_m, 0.0, relax=1.0, joint=FINAL_JOINT_GROUPS
        )
        # a large step leads to another pose
        if step is None or quat.angle_rad(optimum.q, step.q) > FAR_RAD:
            break
        poses.append(step)
    return _mean(poses[1:]) if len(poses) > STEPS else poses[-1]


def _fine_shadows(target: PreparedTarget, close: ImagePatch, optimum: Hypothesis) -> Optional[ShadowMap]:
    """Return a finer shadow map of a hypothesis; None if the shadows explain too little."""
    if optimum.sun is None:
        return None
    faces, camera = faces_of(target), target.camera.pinhole
    visible_face = (
        photo_draw(optimum.q, optimum.t, faces, close, camera).visible_face
        if optimum.view is None
        else optimum.view.visible_face
    )
    sun = ShadowMap.from_faces(faces, optimum.sun.direction, SHADOW_MAP_PX)
    unshadowed, shadowed = (
        explained(photo_shade(visible_face, optimum.q, optimum.t, faces, close, camera, s), close)
        for s in (None, sun)
    )
    return sun if shadowed > unshadowed + MIN_SHADOW_GAIN else None


def _mean(poses: List[PoseFit]) -> PoseFit:
    """Return the mean of nearly equal poses, with the covariance of the last one."""
    last = poses[-1]
    q = np.sum([p.q if p.q @ last.q >= 0 else -p.q for p in poses], axis=0)
    return replace(last, q=q / np.linalg.norm(q), t=np.mean([p.t for p in poses], axis=0))
