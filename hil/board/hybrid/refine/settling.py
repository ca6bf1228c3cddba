"""Last steps of the selected pose: what its final alignment left to chance must not move the answer."""

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
    JOINT_AT_END,
    explained,
    photo_draw,
    photo_shade,
    photo_step,
)

# What shadows must explain beyond the target without them, and the side of their picture from the Sun [px]. Below that
# any Sun does, another one for each rounding of the sums, and each pulls the pose its way: of 60 frames by the C and by
# the NumPy kernels, 24 had Suns that lay 15 deg to 164 deg apart.
WORTH, SIDE_PX = 0.03, 384

# Steps on the sharp image; the mean of the last two is the answer, for what is drawn in pixels makes them hop about.
STEPS = 2


def settle(target: PreparedTarget, frame: Observation, close: ImagePatch, end: Hypothesis) -> PoseFit:
    """The pose of a hypothesis that was refined to its end, the same from wherever it came.

    Parameters
    ----------
    close : patch that ends were scored on.
    """
    longest = ROUND_FINAL_PX if target.round else FINAL_PX
    sharp = cut_patch(target, frame, target_box(target, end.q, end.t), longest)
    exact = replace(sharp, clipped=frame.clipped, exact=True)
    sun = _worthwhile(target, close, end)
    faces, camera = faces_of(target), target.camera.pinhole
    poses = [end.pose]
    for _ in range(STEPS):
        pose = poses[-1]
        view = photo_draw(pose.q, pose.t, faces, exact, camera, sun)
        step = photo_step(
            pose, view, faces, exact, camera, target.radius_m, 0.0, relax=1.0, joint=JOINT_AT_END
        )
        # what still goes far is no end of this pose
        if step is None or quat.angle_rad(end.q, step.q) > FAR_RAD:
            break
        poses.append(step)
    return _mean(poses[1:]) if len(poses) > STEPS else poses[-1]


def _worthwhile(target: PreparedTarget, close: ImagePatch, end: Hypothesis) -> Optional[ShadowMap]:
    """The Sun of a hypothesis in a finer picture; None where its shadows explain too little."""
    if end.sun is None:
        return None
    faces, camera = faces_of(target), target.camera.pinhole
    seen = photo_draw(end.q, end.t, faces, close, camera).seen if end.view is None else end.view.seen
    sun = ShadowMap.of(faces, end.sun.direction, SIDE_PX)
    plain, lit = (
        explained(photo_shade(seen, end.q, end.t, faces, close, camera, s), close) for s in (None, sun)
    )
    return sun if lit > plain + WORTH else None


def _mean(poses: List[PoseFit]) -> PoseFit:
    """The mean of poses that are nearly the same, as sure as the last."""
    last = poses[-1]
    q = np.sum([p.q if p.q @ last.q >= 0 else -p.q for p in poses], axis=0)
    return replace(last, q=q / np.linalg.norm(q), t=np.mean([p.t for p in poses], axis=0))
