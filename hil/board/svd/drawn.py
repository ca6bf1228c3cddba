"""The craft drawn at a pose beside the picture, with and without the shadows it casts on itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.canvas import craft_box, make_canvas
from hil.board.svd.frame import Craft, Frame
from hil.board.svd.levels import OPTICS_PX, blurred, shade
from hil.board.svd.shade import draw_faces

Array = np.ndarray

# Longest side of the drawing [px].
LONGEST_PX = 380


@dataclass(frozen=True, eq=False)
class Drawn:
    """What the picture is compared with at one pose.

    Parameters
    ----------
    picture, plain : (h, w) float32 the picture there, and the craft drawn with one brightness for each group.
    shadowed : (h, w) with shadows; None where no Sun was found. sun : (3,) unit vector to it, camera axes.
    full : largest value of the picture's scale. noise : standard deviation of ``picture``.
    """

    picture: Array
    plain: Array
    shadowed: Optional[Array]
    sun: Optional[Array]
    full: float
    noise: float


def draw_at(craft: Craft, frame: Frame, q: Array, t: Array) -> Optional[Drawn]:
    """The drawing at a pose; None for a target without faces."""
    faces = craft.model.faces
    if faces is None:
        return None
    canvas = make_canvas(craft, frame, craft_box(craft, q, t), LONGEST_PX)
    camera, R = craft.camera.pinhole, quat.matrix(q)
    seen = draw_faces(faces, faces.order(-R.T @ t), camera, R, t, canvas)
    shading = shade(faces, seen, canvas)
    optics = OPTICS_PX / canvas.factor
    plain = canvas.response.of(blurred(shading.picture, optics))[0]
    sun = None if craft.suns is None else craft.suns.find(faces, shading, canvas, camera, R, t)
    if sun is None:
        return Drawn(canvas.gray, plain, None, None, canvas.full, canvas.sigma)
    dark = shade(faces, seen, canvas, sun.shadows(faces, seen, canvas, camera, R, t))
    shadowed = canvas.response.of(blurred(dark.picture, optics))[0]
    return Drawn(canvas.gray, plain, shadowed, R @ sun.direction, canvas.full, canvas.sigma)
