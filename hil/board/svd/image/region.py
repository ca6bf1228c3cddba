"""A box of the image in which the target may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Region:
    """A hypothesis of the target's extent, full-resolution pixels.

    Parameters
    ----------
    x0, y0, x1, y1 : edges of the box. source : the rule that proposed it.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    source: str

    @property
    def diagonal_px(self) -> float:
        """Length of the diagonal [px]."""
        return float(np.hypot(self.x1 - self.x0, self.y1 - self.y0))

    def grown(self, share: float, width: int, height: int) -> Tuple[int, int, int, int]:
        """Integer box enlarged by ``share`` of the diagonal, clipped to the picture."""
        m = max(6.0, share * self.diagonal_px)
        return (
            max(0, int(self.x0 - m)),
            max(0, int(self.y0 - m)),
            min(width, int(np.ceil(self.x1 + m)) + 1),
            min(height, int(np.ceil(self.y1 + m)) + 1),
        )


def overlap(a: Region, b: Region) -> float:
    """Intersection over union of two boxes."""
    w = min(a.x1, b.x1) - max(a.x0, b.x0)
    h = min(a.y1, b.y1) - max(a.y0, b.y0)
    if w <= 0 or h <= 0:
        return 0.0
    union = (a.x1 - a.x0) * (a.y1 - a.y0) + (b.x1 - b.x0) * (b.y1 - b.y0) - w * h
    return float(w * h / max(union, 1e-9))
