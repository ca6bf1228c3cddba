"""Synthetic view: the face visible in each pixel, and the brightness of each group of faces fitted to the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Shading:
    """Rendered target, with brightnesses fitted to the image.

    Parameters
    ----------
    seen : (H, W) array
        Index of the visible face plus 1, per rendered pixel.
    group : (H, W) array
        Brightness group plus 1, per rendered pixel. With shadows, the visible groups are renumbered: lit ones first,
        then shadowed ones.
    level : (G + 1,) array
        Brightness of each group, the background first.
    picture : (h, w) array
        Synthetic image on the patch, before the blur.
    centre : (h, w) array
        Group at the centre of each patch pixel.
    area : (G + 1,) array
        Number of pixels well inside each group.
    behind : (h, w) array, optional
        Background minus its level; None in front of empty space.
    """

    seen: Array
    group: Array
    level: Array
    picture: Array
    centre: Array
    area: Array
    behind: Optional[Array]

    def brightness(self, group: Array, cell: Array) -> Array:
        """Return the brightness (N,) of groups (N,) at the flat patch indices ``cell`` (N,)."""
        level = self.level.take(group, mode="clip")
        if self.behind is not None:
            empty = np.flatnonzero(group == 0)
            level[empty] += self.behind.ravel().take(cell.take(empty))
        return np.asarray(level)
