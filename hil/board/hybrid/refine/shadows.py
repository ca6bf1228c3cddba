"""Search of the Sun by the shadows that the target casts on itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.prepared_target import faces_of
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_shade

if TYPE_CHECKING:
    from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
    from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget

Array = np.ndarray

# Directions of the Sun that are drawn, pixels that they are chosen by, and side of the shadow map [px], before and
# after convergence; the coarse map would leave poses 0.6 deg off.
COARSE, FINE = (1, 240, 96), (4, 500, 160)

# Steps of the refinement of the Sun's direction [rad], whose candidates lie 13 deg apart, and score that its shadows
# must add first.
STEPS_RAD, WORTH = (float(np.radians(4.0)), float(np.radians(2.0))), 0.02


@dataclass(frozen=True, eq=False)
class LitView:
    """A synthetic view with shadows.

    Parameters
    ----------
    shading : Shading
        The view.
    score : float
        Its score.
    sun : ShadowMap, optional
        Source of the shadows; None if no shadows improve the score.
    """

    shading: Shading
    score: float
    sun: Optional[ShadowMap]


def search_sun(
    target: PreparedTarget,
    patch: ImagePatch,
    q: Array,
    t: Array,
    plain: Optional[Shading] = None,
    *,
    seen: Optional[Array] = None,
    coarse: bool = False,
) -> LitView:
    """Return the view of the target with the shadows that explain the image best, or with those of the given Sun.

    Shadows raise the score of the right pose; those on a wrong pose do not lie where the image is dark.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Reduced region of the image around the target.
    q, t : (4,), (3,) array
        Pose of the target: quaternion and position [m].
    plain : Shading, optional
        View without shadows, if there is one.
    seen : (H, W) array, optional
        Faces drawn at the pose, used if there is no such view.
    coarse : bool
        Try fewer directions on fewer pixels, without refinement, at the loss of a third of the gain.
    """
    faces, camera = faces_of(target), target.camera.pinhole
    if plain is None and seen is not None:
        plain = photo_shade(seen, q, t, faces, patch, camera)
    plain = photo_draw(q, t, faces, patch, camera) if plain is None else plain
    best = LitView(plain, explained(plain, patch), None)
    if target.suns is None:
        return best

    number, pixels, side = COARSE if coarse else FINE

    def tried(sun: ShadowMap) -> LitView:
        shading = photo_shade(plain.seen, q, t, faces, patch, camera, sun)
        return LitView(shading, explained(shading, patch), sun)

    if patch.sun is not None:
        # none in eclipse
        return max(best, tried(ShadowMap.of(faces, quat.matrix(q).T @ patch.sun, side)), key=_score)
    least = best.score + WORTH
    for k in target.suns.find(faces, plain, patch, camera, quat.matrix(q), t, number, pixels):
        best = max(best, tried(target.suns.sunlight(faces, k, side)), key=_score)
    if coarse or best.score < least:
        return best
    for step in STEPS_RAD:
        for axis in range(2):
            for way in (1.0, -1.0):
                sun = best.sun
                if sun is None:
                    continue
                best = max(
                    best,
                    tried(ShadowMap.of(faces, _beside(sun, step, way * sun.axes[axis]), side)),
                    key=_score,
                )
                if best.sun is not sun:
                    # the other side cannot be better as well
                    break
    return best


def sharpen_shadows(
    target: PreparedTarget, patch: ImagePatch, q: Array, t: Array, drawn: LitView, side: int
) -> LitView:
    """Return the view with the shadows of a map of ``side`` pixels, if these explain more.

    Thin parts cast no shadow on a coarse map: the edge of a solar array is a third of its pixel.
    """
    if drawn.sun is None:
        return drawn
    faces = faces_of(target)
    sun = ShadowMap.of(faces, drawn.sun.direction, side)
    shading = photo_shade(drawn.shading.seen, q, t, faces, patch, target.camera.pinhole, sun)
    return max(drawn, LitView(shading, explained(shading, patch), sun), key=_score)


def _score(drawn: LitView) -> float:
    return drawn.score


def _beside(sun: ShadowMap, angle_rad: float, side: Array) -> Array:
    """Return the direction (3,) turned from the Sun's towards a unit vector ``side`` (3,) perpendicular to it."""
    return np.asarray(np.cos(angle_rad) * sun.direction + np.sin(angle_rad) * side)
