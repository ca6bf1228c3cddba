"""The target drawn at a pose beside the picture, with and without the shadows it casts on itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.many_groups import blurred
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.photometric import photo_draw
from flyaround.hil.board.hybrid.refine.shadows import search_sun

Array = np.ndarray

# Longest side of the drawing [px].
LONGEST_PX = 380


@dataclass(frozen=True, eq=False)
class Drawn:
    """What the picture is compared with at one pose.

    Parameters
    ----------
    picture, plain : (h, w) float32 the picture there, and the target drawn with one brightness for each group.
    shadowed : (h, w) with shadows; None where no Sun was found. sun : (3,) unit vector to it, camera axes.
    full : largest value of the picture's scale. noise : standard deviation of ``picture``.
    """

    picture: Array
    plain: Array
    shadowed: Optional[Array]
    sun: Optional[Array]
    full: float
    noise: float


def draw_at(target: PreparedTarget, frame: Observation, q: Array, t: Array) -> Optional[Drawn]:
    """The drawing at a pose; None for a target without faces."""
    faces = target.model.faces
    if faces is None:
        return None
    patch = cut_patch(target, frame, target_box(target, q, t), LONGEST_PX)
    plain = photo_draw(q, t, faces, patch, target.camera.pinhole).picture
    best = search_sun(target, faces, patch, q, t)
    optics = OPTICS_PX / patch.factor
    plain, dark = (patch.response.of(blurred(p, optics))[0] for p in (plain, best.shading.picture))
    if best.sun is None:
        return Drawn(patch.gray, plain, None, None, patch.full, patch.sigma)
    sun = quat.matrix(q) @ best.sun.direction
    return Drawn(patch.gray, plain, dark, sun, patch.full, patch.sigma)
