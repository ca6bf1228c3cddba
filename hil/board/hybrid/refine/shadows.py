"""A pose drawn with the shadows the target casts on itself, the Sun where the picture wants it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_shade

if TYPE_CHECKING:
    from flyaround.hil.board.estimation.faces import Faces
    from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
    from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget

Array = np.ndarray

# Directions of the Sun whose shadows are drawn, pixels that they are chosen by, and side of the target's picture from
# each [px]: of a pose on its way, and at its end, where the coarser picture's blunt shadows left poses 0.6 deg off.
COARSE, FINE = (1, 240, 96), (4, 500, 160)

# Steps by which the Sun's direction is made better at the end [rad], and what its shadows must explain for that: over
# 41 development frames the median error of attitude falls by a fifth, and the table's directions lie 13 deg apart.
STEPS_RAD, WORTH = (float(np.radians(4.0)), float(np.radians(2.0))), 0.02


@dataclass(frozen=True, eq=False)
class LitView:
    """A target drawn with its shadows.

    Parameters
    ----------
    shading : as drawn. score : how well it explains the picture. sun : None where no shadows explain it better.
    """

    shading: Shading
    score: float
    sun: Optional[ShadowMap]


def search_sun(
    target: PreparedTarget,
    faces: Faces,
    patch: ImagePatch,
    q: Array,
    t: Array,
    plain: Optional[Shading] = None,
    *,
    seen: Optional[Array] = None,
    coarse: bool = False,
) -> LitView:
    """The target at a pose with the shadows that explain the picture best; of a Sun that is known, with its shadows.

    A wrong pose has the same choice of Suns, but what they cast on it does not lie where the picture is dark: over 13
    development frames that were lost the right pose explains 0.05 to 0.55 more with its shadows, others hardly any.

    Parameters
    ----------
    faces : of the target. q, t : the pose. plain : drawn there without shadows, where it is; seen : or which faces
        are seen there, where that alone is known. coarse : try
        fewer directions on fewer pixels and leave it at that, which lets go of a third of what shadows explain.
    """
    camera = target.camera.pinhole
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
        # in eclipse it casts none
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
                    # where one side is better the other is not
                    break
    return best


def sharpen_shadows(
    target: PreparedTarget, faces: Faces, patch: ImagePatch, q: Array, t: Array, drawn: LitView, side: int
) -> LitView:
    """The same with the shadows of a Sun's picture of ``side`` pixels, where these explain more.

    What is thin shades nothing on a coarse one: a wing's edge is a third of such a pixel.
    """
    if drawn.sun is None:
        return drawn
    sun = ShadowMap.of(faces, drawn.sun.direction, side)
    shading = photo_shade(drawn.shading.seen, q, t, faces, patch, target.camera.pinhole, sun)
    return max(drawn, LitView(shading, explained(shading, patch), sun), key=_score)


def _score(drawn: LitView) -> float:
    return drawn.score


def _beside(sun: ShadowMap, angle_rad: float, side: Array) -> Array:
    """Direction (3,) beside the Sun's, towards a unit vector ``side`` (3,) across it."""
    return np.asarray(np.cos(angle_rad) * sun.direction + np.sin(angle_rad) * side)
