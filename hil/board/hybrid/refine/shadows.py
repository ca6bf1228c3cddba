"""Search of the Sun's direction whose cast shadows on the target explain the image best."""

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

# Number of Sun directions to render, number of pixels by which they are selected, and side of the shadow map [px]: for
# a hypothesis that has not converged, and for one that has. The coarse map causes attitude errors of up to 0.6 deg.
COARSE_SEARCH, FINE_SEARCH = (1, 240, 96), (4, 500, 160)

# Steps by which the Sun's direction is refined [rad] (candidates are 13 deg apart), and minimum gain of the score by
# shadows for which refinement is worth its time.
STEPS_RAD, MIN_GAIN = (float(np.radians(4.0)), float(np.radians(2.0))), 0.02


@dataclass(frozen=True, eq=False)
class LitView:
    """A synthetic view with shadows.

    Parameters
    ----------
    shading : Shading
        Rendered target.
    score : float
        Share of the image that the view explains, see `explained`.
    sun : ShadowMap, optional
        Shadow map of the Sun's direction; None if no shadows improve the score.
    """

    shading: Shading
    score: float
    sun: Optional[ShadowMap]


def search_sun(
    target: PreparedTarget,
    patch: ImagePatch,
    q: Array,
    t: Array,
    unshadowed: Optional[Shading] = None,
    *,
    visible_face: Optional[Array] = None,
    coarse: bool = False,
) -> LitView:
    """Return the view of the target with the shadows that explain the image best.

    If the patch has the Sun's direction, only that direction is rendered. Shadows raise the score of a correct pose;
    with a wrong pose they do not coincide with dark areas of the image.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    patch : ImagePatch
        Reduced region of the image around the target.
    q : (4,) array
        Attitude, camera from target.
    t : (3,) array
        Position of the target, camera axes [m].
    unshadowed : Shading, optional
        View without shadows at this pose, if already rendered.
    visible_face : (H, W) array, optional
        Face indices rendered at this pose, from which that view is shaded.
    coarse : bool
        Try fewer directions on fewer pixels, without refinement: faster, with less of the gain.
    """
    faces, camera = faces_of(target), target.camera.pinhole
    if unshadowed is None and visible_face is not None:
        unshadowed = photo_shade(visible_face, q, t, faces, patch, camera)
    unshadowed = photo_draw(q, t, faces, patch, camera) if unshadowed is None else unshadowed
    best = LitView(unshadowed, explained(unshadowed, patch), None)
    if target.suns is None:
        return best

    number, pixels, side = COARSE_SEARCH if coarse else FINE_SEARCH

    def lit_by(sun: ShadowMap) -> LitView:
        shading = photo_shade(unshadowed.visible_face, q, t, faces, patch, camera, sun)
        return LitView(shading, explained(shading, patch), sun)

    if patch.sun is not None:
        # the view without shadows wins in eclipse
        return max(best, lit_by(ShadowMap.from_faces(faces, quat.matrix(q).T @ patch.sun, side)), key=_score)
    min_score = best.score + MIN_GAIN
    for k in target.suns.find(faces, unshadowed, patch, camera, quat.matrix(q), t, number, pixels):
        best = max(best, lit_by(target.suns.sunlight(faces, k, side)), key=_score)
    if coarse or best.score < min_score:
        return best
    for step in STEPS_RAD:
        for axis in range(2):
            for sign in (1.0, -1.0):
                sun = best.sun
                if sun is None:
                    continue
                best = max(
                    best,
                    lit_by(
                        ShadowMap.from_faces(faces, _rotate_towards(sun, step, sign * sun.axes[axis]), side)
                    ),
                    key=_score,
                )
                if best.sun is not sun:
                    # the score increased in this direction, so it cannot increase in the opposite one
                    break
    return best


def sharpen_shadows(
    target: PreparedTarget, patch: ImagePatch, q: Array, t: Array, drawn: LitView, side: int
) -> LitView:
    """Return the view with shadows from a map of ``side`` pixels, if its score is higher.

    A coarse shadow map misses thin parts: a solar array seen edge-on is a third of a texel wide.
    """
    if drawn.sun is None:
        return drawn
    faces = faces_of(target)
    sun = ShadowMap.from_faces(faces, drawn.sun.direction, side)
    shading = photo_shade(drawn.shading.visible_face, q, t, faces, patch, target.camera.pinhole, sun)
    return max(drawn, LitView(shading, explained(shading, patch), sun), key=_score)


def _score(drawn: LitView) -> float:
    return drawn.score


def _rotate_towards(sun: ShadowMap, angle_rad: float, side: Array) -> Array:
    """Rotate the Sun's direction (3,) by an angle towards ``side`` (3,), a unit vector perpendicular to it."""
    return np.asarray(np.cos(angle_rad) * sun.direction + np.sin(angle_rad) * side)
