"""Photometric alignment during tracking: a synthetic view with cast shadows, the Sun near its last direction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_shade, photo_step
from flyaround.hil.board.hybrid.refine.shadows import search_sun

Array = np.ndarray
Pose = Tuple[Array, Array]

# Longest side of the rendering [px], and the blur of each alignment step [px].
PATCH_PX, BLURS_PX = 120, (1.2, 0.6)

# Minimum score gain by which a candidate replaces the most likely pose: a rendering this small hardly resolves 5 deg.
MIN_SCORE_GAIN = 0.02

# Factor on the covariance of ``photo_step``, which is calibrated for arbitrary starts; predicted poses are closer
# (fly-arounds of Tango at 7 to 11 m).
COVARIANCE_SCALE = 0.6

# Side of the shadow map [px], and angle between the last Sun direction and its alternatives [rad]: in a fly-around the
# camera turns by one or two degrees per frame.
SUN_PX, SUN_STEP_RAD = 96, float(np.radians(4.0))


@dataclass(frozen=True, eq=False)
class PhotometricTrack:
    """A pose tracked by its synthetic view.

    Parameters
    ----------
    fit : PoseFit
        Aligned pose.
    sun : (3,) array, optional
        Unit vector to the Sun, camera axes; None if no shadows are visible.
    """

    fit: PoseFit
    sun: Optional[Array]


def find_sun(craft: PreparedTarget, frame: Observation, pose: Pose) -> Optional[Array]:
    """Return the direction (3,) to the Sun, camera axes, from the shadows at a pose; None if none explain the image."""
    if craft.model.faces is None:
        return None
    sun = search_sun(craft, _patch(craft, frame, pose), *pose).sun
    return None if sun is None else quat.matrix(pose[0]) @ sun.direction


def align_photometrically(
    craft: PreparedTarget,
    frame: Observation,
    poses: Tuple[Pose, ...],
    sun: Optional[Array],
    *,
    follow_sun: bool = True,
) -> PhotometricTrack:
    """Return the pose whose synthetic view explains the image best, refined.

    Parameters
    ----------
    craft : PreparedTarget
        Target with its precomputed tables.
    frame : Observation
        Image with its noise and background.
    poses : tuple of pose
        Candidates, most likely first. Both the edge-aligned and the predicted pose are needed: alignment may lock on
        wrong edges, and the prediction is wrong after a change of rates.
    sun : (3,) array, optional
        Sun direction from the previous call.
    follow_sun : bool
        Search around that direction as well.
    """
    faces, camera = faces_of(craft), craft.camera.pinhole
    patch = _patch(craft, frame, poses[0])
    shadow = None if sun is None else ShadowMap.from_faces(faces, quat.matrix(poses[0][0]).T @ sun, SUN_PX)
    shadings = [photo_draw(q, t, faces, patch, camera, shadow) for q, t in poses]
    scores = [explained(shading, patch) for shading in shadings]
    first = int(np.argmax(scores))
    if scores[first] < scores[0] + MIN_SCORE_GAIN:
        first = 0
    view, fit = shadings[first], PoseFit(*poses[first])
    if shadow is not None and follow_sun:
        shadow, view = _follow_sun(craft, patch, fit, shadow, view)
    for k, blur in enumerate(BLURS_PX):
        if k:
            view = photo_draw(fit.q, fit.t, faces, patch, camera, shadow)
        step = photo_step(fit, view, faces, patch, camera, craft.radius_m, blur)
        if step is None:
            break
        fit = step
    fit = replace(fit, covariance=COVARIANCE_SCALE * fit.covariance)
    return PhotometricTrack(fit, None if shadow is None else quat.matrix(fit.q) @ shadow.direction)


def _patch(craft: PreparedTarget, frame: Observation, pose: Pose) -> ImagePatch:
    """Return the patch around a pose."""
    return replace(cut_patch(craft, frame, target_box(craft, *pose), PATCH_PX), exact=True)


def _follow_sun(
    craft: PreparedTarget, patch: ImagePatch, fit: PoseFit, sun: ShadowMap, view: Shading
) -> Tuple[ShadowMap, Shading]:
    """Return a Sun direction whose shadows explain the image at least as well, and the view shaded with it.

    Four neighbouring directions are tried until one is better.
    """
    best = explained(view, patch)
    for k in range(4):
        side = (1 - k // 2 * 2) * sun.axes[k % 2]
        neighbour = np.cos(SUN_STEP_RAD) * sun.direction + np.sin(SUN_STEP_RAD) * side
        candidate = ShadowMap.from_faces(faces_of(craft), neighbour, SUN_PX)
        shading = photo_shade(
            view.visible_face, fit.q, fit.t, faces_of(craft), patch, craft.camera.pinhole, candidate
        )
        if explained(shading, patch) > best:
            return candidate, shading
    return sun, view
