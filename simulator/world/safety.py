"""The keep-out sphere about the target, its approach corridor, and the abort that defends them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulator.arrays import FloatArray, Vec3


@dataclass(frozen=True, kw_only=True)
class KeepOut:
    """A sphere that may be entered through a cone only; anywhere else the chaser breaks off and retreats.

    Parameters
    ----------
    radius_m : of the sphere about the target's centre of mass.
    corridor_axis_lvlh : from the target outward along the cone; None closes the sphere.
    corridor_half_angle_rad : of the cone.
    retreat_m_s : speed straight outward after an abort, until twice the radius; then free drift.
    """

    radius_m: float
    corridor_axis_lvlh: Vec3 | None = None
    corridor_half_angle_rad: float = 0.0
    retreat_m_s: float = 0.1

    def violated(self, position_lvlh_m: FloatArray) -> bool:
        """Whether a position is inside the sphere and outside the corridor."""
        distance = float(np.linalg.norm(position_lvlh_m))
        if distance >= self.radius_m:
            return False
        if self.corridor_axis_lvlh is None or distance == 0.0:
            return True
        axis = np.array(self.corridor_axis_lvlh, float)
        cosine = float(position_lvlh_m @ axis) / (distance * float(np.linalg.norm(axis)))
        return cosine < np.cos(self.corridor_half_angle_rad)
