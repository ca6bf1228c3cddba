"""A craft seen along parallel light: the box that shadow maps and baked light are drawn in."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.skylight import axes_about

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray

WIDER = 1.02
"""Half the box, over the radius of the craft."""
_TURN_RAD = 0.38


def light_matrix(center_m: FloatArray, radius_m: float, along: FloatArray) -> FloatArray:
    """(4, 4) clip matrix of an orthographic box around a sphere, seen along a unit vector.

    The box is turned about the light: edges of a craft follow its axes, and one along a map's rows would lie half a
    texel off over all its length.
    """
    x, y, z = axes_about(along)
    c, s = math.cos(_TURN_RAD), math.sin(_TURN_RAD)
    R = np.array([c * x + s * y, c * y - s * x, z]) / (radius_m * WIDER)
    matrix = np.eye(4)
    matrix[:3, :3] = R
    matrix[:3, 3] = -R @ center_m
    return matrix
