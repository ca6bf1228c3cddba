"""Fields of solar cells: a grid of thin tiles with clipped corners."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.builders.mesh import Mesh, merge
from flyaround.simulator.targets.builders.prism import prism

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


def clipped_rectangle(width_m: float, height_m: float, clip_m: float, clipped: str) -> FloatArray:
    """Corners of a rectangle about the origin with two or four of its corners cut at 45 degrees.

    Parameters
    ----------
    clipped : ``"top"``, ``"bottom"`` (a half wafer) or ``"all"``.
    """
    x, y = width_m / 2, height_m / 2
    low = [(-x, -y + clip_m), (-x + clip_m, -y), (x - clip_m, -y), (x, -y + clip_m)]
    high = [(x, y - clip_m), (x - clip_m, y), (-x + clip_m, y), (-x, y - clip_m)]
    if clipped == "top":
        low = [(-x, -y), (x, -y)]
    elif clipped == "bottom":
        high = [(x, y), (-x, y)]
    return np.array(low + high)


def cell_grid(
    centres_x_m: ArrayLike, centres_y_m: ArrayLike, outline: ArrayLike, z_m: float, thickness_m: float
) -> Mesh:
    """Tiles of one outline (K, 2) at every crossing of the two lists of centres, lying at ``z_m``."""
    tile = prism(outline, thickness_m)
    xs, ys = np.asarray(centres_x_m, float), np.asarray(centres_y_m, float)
    return merge([tile.moved((x, y, z_m)) for y in ys for x in xs])
