"""Synthetic views of a pose for debug images, with and without shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_formation import blurred
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.photometric import photo_draw
from flyaround.hil.board.hybrid.refine.shadows import search_sun

Array = np.ndarray

# Longest side of the rendering [px].
LONGEST_PX = 380


@dataclass(frozen=True, eq=False)
class SyntheticViews:
    """Image and synthetic views of one pose.

    Parameters
    ----------
    picture : (h, w) array
        Image, float32.
    plain : (h, w) array
        View with one brightness per group.
    shadowed : (h, w) array, optional
        View with shadows; None if no Sun direction was found.
    sun : (3,) array, optional
        Unit vector to the Sun, camera axes.
    full : float
        Full scale of the image.
    noise : float
        Standard deviation of the image noise.
    """

    picture: Array
    plain: Array
    shadowed: Optional[Array]
    sun: Optional[Array]
    full: float
    noise: float


def draw_at(target: PreparedTarget, frame: Observation, q: Array, t: Array) -> Optional[SyntheticViews]:
    """Return the views of a pose; None for a target without faces."""
    faces = target.model.faces
    if faces is None:
        return None
    patch = cut_patch(target, frame, target_box(target, q, t), LONGEST_PX)
    plain = photo_draw(q, t, faces, patch, target.camera.pinhole).picture
    best = search_sun(target, patch, q, t)
    optics = OPTICS_PX / patch.factor
    plain, dark = (patch.response.mean(blurred(p, optics)) for p in (plain, best.shading.picture))
    if best.sun is None:
        return SyntheticViews(patch.gray, plain, None, None, patch.full_scale, patch.sigma)
    sun = quat.matrix(q) @ best.sun.direction
    return SyntheticViews(patch.gray, plain, dark, sun, patch.full_scale, patch.sigma)
