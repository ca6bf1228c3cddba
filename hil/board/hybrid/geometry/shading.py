"""A synthetic view: which face each pixel shows, and the radiometric gain that the image gives each group of faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Shading:
    """The drawn craft with the brightness that the picture gives it.

    Parameters
    ----------
    seen : (H, W) face + 1 per drawn pixel. group : (H, W) brightness group + 1; where shadows are cast, groups
        that are seen are numbered anew, and those in shadow follow those in light.
    level : (G + 1,) brightness of each group, the background first.
    picture : (h, w) what it looks like on the patch, not blurred.
    centre : (h, w) group at a pixel's middle. area : (G + 1,) pixels well inside each group.
    behind : (h, w) what the background differs from its level by; None where it is empty space.
    """

    seen: Array
    group: Array
    level: Array
    picture: Array
    centre: Array
    area: Array
    behind: Optional[Array]

    def brightness(self, group: Array, cell: Array) -> Array:
        """(N,) of groups (N,) at patch pixels ``cell`` (N,), flat indices."""
        level = self.level.take(group, mode="clip")
        if self.behind is not None:
            empty = np.flatnonzero(group == 0)
            level[empty] += self.behind.ravel().take(cell.take(empty))
        return np.asarray(level)
