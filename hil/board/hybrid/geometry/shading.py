"""Synthetic view of the target.

It holds the face visible in each pixel, and the brightness of each group of faces, fitted to the image.
"""

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
    visible_face : (H, W) array
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
    background_offset : (h, w) array, optional
        Background minus its level; None in front of empty space.
    """

    visible_face: Array
    group: Array
    level: Array
    picture: Array
    centre: Array
    area: Array
    background_offset: Optional[Array]
