"""A pose drawn with the shadows the craft casts on itself, the Sun where the picture wants it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.levels import Shading
from hil.board.svd.photometric import explained, photo_draw, photo_shade
from hil.board.svd.sunlight import Sunlight

if TYPE_CHECKING:
    from hil.board.svd.frame import Craft
    from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray

# Directions of the Sun whose shadows are drawn, and pixels that they are chosen by: of a pose on its way, and at its
# end; side of the craft's picture from each [px].
COARSE, FINE = (2, 240), (3, 700)
MAP_PX = 128


@dataclass(frozen=True, eq=False)
class Shadowed:
    """A craft drawn with its shadows.

    Parameters
    ----------
    shading : as drawn. score : how well it explains the picture. sun : None where no shadows explain it better.
    """

    shading: Shading
    score: float
    sun: Optional[Sunlight]


def shadowed(
    craft: Craft,
    faces: Faces,
    canvas: Canvas,
    q: Array,
    t: Array,
    plain: Optional[Shading] = None,
    *,
    coarse: bool = False,
) -> Shadowed:
    """The craft at a pose with the shadows that explain the picture best.

    A wrong pose has the same choice of Suns, but what they cast on it does not lie where the picture is dark: over 13
    development frames that were lost the right pose explains 0.05 to 0.55 more with its shadows, others hardly any.

    Parameters
    ----------
    faces : of the craft. q, t : the pose. plain : drawn there without shadows, where it is. coarse : try
        fewer directions on fewer pixels, which lets go of 0.005 of 0.06 that shadows explain in the mean.
    """
    camera = craft.camera.pinhole
    plain = photo_draw(q, t, faces, canvas, camera) if plain is None else plain
    best = Shadowed(plain, explained(plain, canvas), None)
    if craft.suns is None:
        return best
    number, pixels = COARSE if coarse else FINE
    for direction in craft.suns.find(faces, plain, canvas, camera, quat.matrix(q), t, number, pixels):
        sun = Sunlight.of(faces, direction, MAP_PX)
        shading = photo_shade(plain.seen, q, t, faces, canvas, camera, sun)
        score = explained(shading, canvas)
        if score > best.score:
            best = Shadowed(shading, score, sun)
    return best
