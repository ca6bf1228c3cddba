"""Camera attitude: the boresight at the target, the picture's down side along a reference of LVLH."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from simulator.world.attitude.directions import unit_and_rate
from simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
)
from simulator.world.frames.vectors import cross, length

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.world.frames.lvlh import Lvlh

Down = Literal["nadir", "cross_track", "along_track"]

DOWN_AXES_LVLH: dict[Down, tuple[float, float, float]] = {
    "nadir": (-1.0, 0.0, 0.0),
    "cross_track": (0.0, 0.0, -1.0),
    "along_track": (0.0, -1.0, 0.0),
}
"""Where the picture's down side points: to the Earth, against the orbit normal, against the flight."""

_DEGENERATE = 1e-4
"""Sine of the angle between boresight and reference below which the reference says nothing."""


@dataclass(frozen=True, kw_only=True)
class Pointing:
    """Boresight (+z) at the target's centre of mass, then a constant turn.

    Parameters
    ----------
    down : direction that the image's y axis follows. When the boresight runs along it the next of nadir,
        cross_track, along_track takes its place for that moment.
    right_rad, below_rad : the boresight turned this far to the right of and below the target, which then
        appears left of and above the centre.
    roll_rad : the camera turned about its boresight, clockwise as its operator sees it: the picture turns
        anticlockwise.
    """

    down: Down = "nadir"
    right_rad: float = 0.0
    below_rad: float = 0.0
    roll_rad: float = 0.0

    def attitude(
        self, los_eci_m: FloatArray, los_rate_eci_m_s: FloatArray, lvlh: Lvlh
    ) -> tuple[FloatArray, FloatArray]:
        """Attitude and rate of the camera.

        Parameters
        ----------
        los_eci_m, los_rate_eci_m_s : (3,) target minus camera and its derivative, GCRS axes.
        lvlh : the target's frame, whose axes ``down`` names.

        Returns
        -------
        ``q_camera_from_eci_wxyz`` (4,) and the rate relative to ECI in the camera frame [rad s-1] (3,).
        """
        z, z_rate = unit_and_rate(los_eci_m, los_rate_eci_m_s)
        d = self._reference(z, lvlh)
        d_rate = cross(lvlh.omega_eci_rad_s, d)
        across = d - (d @ z) * z
        across_rate = d_rate - (d_rate @ z + d @ z_rate) * z - (d @ z) * z_rate
        y, y_rate = unit_and_rate(across, across_rate)
        x = cross(y, z)
        x_rate = cross(y_rate, z) + cross(y, z_rate)
        q = quat_from_matrix(np.stack([x, y, z]))
        omega = np.array([y_rate @ z, z_rate @ x, x_rate @ y])
        turn = self._turn
        return quat_multiply(turn, q), matrix_from_quat(turn) @ omega

    def _reference(self, z: FloatArray, lvlh: Lvlh) -> FloatArray:
        for name in (self.down, *(name for name in DOWN_AXES_LVLH if name != self.down)):
            d = lvlh.R_eci_from_lvlh @ np.array(DOWN_AXES_LVLH[name])
            if length(cross(d, z)) > _DEGENERATE:
                break
        return d

    @cached_property
    def _turn(self) -> FloatArray:
        """``q_turned_from_pointed``: right about +y, then down about -x, then roll about +z."""
        right = quat_from_rotvec([0.0, self.right_rad, 0.0])
        down = quat_from_rotvec([-self.below_rad, 0.0, 0.0])
        roll = quat_from_rotvec([0.0, 0.0, self.roll_rad])
        return quat_conjugate(quat_multiply(quat_multiply(right, down), roll))
