"""Position of a free camera that circles target or chaser, and the size of its pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

About = Literal["target", "chaser"]
ABOUT: tuple[About, ...] = ("target", "chaser")
FIRST = (-60.0, 25.0, 12.0)  # initial azimuth [deg], elevation [deg] and least initial distance [m]
AWAY = 3.3
"""Ratio of the distance to the chaser's range: both stay within asin(1 / 3.3) = 18 deg of the middle of 40 deg."""
SAME_M = 0.006  # difference of distances that rounding to centimetres makes
NEAREST_M, FARTHEST_M = 0.6, 20_000.0  # bounds of the distance
STEEPEST_DEG = 89.0  # largest elevation: at 90 deg the azimuth would be undefined
LARGEST_PX = (960, 640)  # largest picture, for its drawing time
_STEP_PX = 16
"""Quantisation of the picture size, so that resizing a view seldom changes it."""


@dataclass
class OrbitCamera:
    """Position of the free camera in the target's LVLH frame, radial up.

    Parameters
    ----------
    about : About, optional
        Object that it circles and looks at.
    azimuth_deg : float, optional
        0 looks along-track, 90 along minus cross-track.
    elevation_deg : float, optional
        Above the local horizontal plane.
    distance_m : float, optional
        Distance from that object.
    size_px : tuple of int, optional
        Width and height of the rendered view.
    follows : bool, optional
        True while the distance keeps target and chaser in view; a distance that is chosen ends it.
    """

    about: About = "target"
    azimuth_deg: float = FIRST[0]
    elevation_deg: float = FIRST[1]
    distance_m: float = FIRST[2]
    size_px: tuple[int, int] = (480, 304)
    follows: bool = True

    def place(self, azimuth_deg: float, elevation_deg: float, distance_m: float) -> None:
        """Move the camera; wrap the azimuth, and clip elevation and distance to their bounds."""
        self.follows &= abs(distance_m - self.distance_m) < SAME_M
        self.azimuth_deg = (azimuth_deg + 180.0) % 360.0 - 180.0
        self.elevation_deg = min(max(elevation_deg, -STEEPEST_DEG), STEEPEST_DEG)
        self.distance_m = min(max(distance_m, NEAREST_M), FARTHEST_M)

    def reset(self, range_m: float) -> None:
        """Move to the initial position for a chaser at ``range_m`` from the target."""
        self.place(FIRST[0], FIRST[1], self.distance_m)
        self.follows = True
        self.follow(range_m)

    def follow(self, range_m: float) -> None:
        """Keep target and chaser in view, unless a distance was chosen."""
        if self.follows:
            self.distance_m = min(max(FIRST[2], AWAY * range_m), FARTHEST_M)

    def fill(self, width: float, height: float) -> None:
        """Set the picture size for a view of this size on the screen."""
        scale = min(1.0, LARGEST_PX[0] / max(width, 1.0), LARGEST_PX[1] / max(height, 1.0))
        w, h = (max(int(x * scale) // _STEP_PX * _STEP_PX, 4 * _STEP_PX) for x in (width, height))
        self.size_px = (w, h)

    @property
    def from_focus_lvlh(self) -> FloatArray:
        """(3,) unit vector from the object to the camera, LVLH axes."""
        az, el = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        return np.array([math.sin(el), -math.cos(el) * math.cos(az), math.cos(el) * math.sin(az)])
