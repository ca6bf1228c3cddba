"""A synthetic view: the face that each pixel shows, and the brightness of each group of faces, from the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Shading:
    """The drawn craft with brightness from the image.

    Parameters
    ----------
    seen : (H, W) array
        Face + 1 per drawn pixel.
    group : (H, W) array
        Brightness group + 1 per drawn pixel. With shadows, visible groups are renumbered: those in light, then those in
        shadow.
    level : (G + 1,) array
        Brightness of each group, the background first.
    picture : (h, w) array
        The view on the patch, not blurred.
    centre : (h, w) array
        Group at each patch pixel's centre.
    area : (G + 1,) array
        Pixels well inside each group.
    behind : (h, w) array, optional
        Background minus its level; None before empty space.
    """

    seen: Array
    group: Array
    level: Array
    picture: Array
    centre: Array
    area: Array
    behind: Optional[Array]

    def brightness(self, group: Array, cell: Array) -> Array:
        """Return the brightness (N,) of groups (N,) at patch pixels ``cell`` (N,), flat indices."""
        level = self.level.take(group, mode="clip")
        if self.behind is not None:
            empty = np.flatnonzero(group == 0)
            level[empty] += self.behind.ravel().take(cell.take(empty))
        return np.asarray(level)
