"""Place of a picture on the screen: as large as fits, with its aspect ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.gui.picture.truth_overlay import Pixel
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class Letterbox:
    """Place of a picture on the screen.

    Parameters
    ----------
    x : float
        Column of the picture's left edge on the screen.
    y : float
        Row of the picture's top edge on the screen.
    width : float
        Width on the screen.
    height : float
        Height on the screen.
    scale : float
        Screen units per pixel of the picture.
    """

    x: float
    y: float
    width: float
    height: float
    scale: float

    @staticmethod
    def fit(image: tuple[int, int], place: tuple[float, float, float, float]) -> Letterbox:
        """Return the largest centred rectangle of the image's aspect inside ``place`` (x, y, width, height)."""
        x, y, width, height = place
        scale = min(width / image[0], height / image[1])
        w, h = image[0] * scale, image[1] * scale
        return Letterbox(x + (width - w) / 2, y + (height - h) / 2, w, h, scale)

    def at(self, pixel: Pixel) -> Pixel:
        """Return the screen position of a point of the picture; pixel (0, 0) is the centre of the first one."""
        return (self.x + (pixel[0] + 0.5) * self.scale, self.y + (pixel[1] + 0.5) * self.scale)

    def all_at(self, pixels: FloatArray) -> FloatArray:
        """Return the screen positions of many points (..., 2)."""
        return np.array([self.x, self.y]) + (pixels + 0.5) * self.scale
