"""A convex polygon around the target in the image, so that the corners of its bounding box are not shaded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import FloatArray

SIDES = 16
MARGIN_PX = 1.0  # a pixel whose corner the target touches has its centre up to 0.71 pixels outside
_TURN = 2 * np.pi * np.arange(SIDES) / SIDES
_NORMALS = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=1)


def outline_px(points_px: FloatArray) -> FloatArray:
    """(16, 2) corners, in order, of the polygon of 16 fixed directions that holds every point with a margin.

    Parameters
    ----------
    points_px : (K, 2) projected points.
    """
    reach = (points_px @ _NORMALS.T).max(axis=0) + MARGIN_PX
    # a corner is where neighbouring sides meet: both distances are met, 22.5 degrees apart
    after, step = np.roll(reach, -1), 2 * np.pi / SIDES
    along = (after - reach * np.cos(step)) / np.sin(step)
    sideways = np.stack([-_NORMALS[:, 1], _NORMALS[:, 0]], axis=1)
    return np.asarray(reach[:, None] * _NORMALS + along[:, None] * sideways)
