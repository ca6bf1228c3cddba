"""A craft seen along parallel light: the box that shadow maps and baked light are drawn in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import FloatArray

WIDER = 1.02
"""Half the box, over the radius of the craft."""
_TURN_RAD = 0.38


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """(4, 4) clip matrix of an orthographic box around a sphere, seen along a unit vector.

    The box is turned about the light: edges of a craft follow its axes, and one along a map's rows would lie half a
    texel off over all its length.
    """
    x = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    x = np.cos(_TURN_RAD) * x + np.sin(_TURN_RAD) * np.cross(along, x)
    R = np.stack([x, np.cross(along, x), along]) / (radius_m * WIDER)
    matrix = np.eye(4)
    matrix[:3, :3] = R
    matrix[:3, 3] = -R @ center_m
    return matrix
