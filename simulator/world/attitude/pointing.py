"""Camera attitude: boresight towards the target, and the image's down side along a reference direction in LVLH."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.sections import Degrees, Section
from flyaround.simulator.world.attitude.directions import unit_and_rate
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
)
from flyaround.simulator.world.frames.vectors import cross, length

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.frames.lvlh import Lvlh

Down = Literal["nadir", "cross_track", "along_track"]

DOWN_AXES_LVLH: dict[Down, tuple[float, float, float]] = {
    "nadir": (-1.0, 0.0, 0.0),
    "cross_track": (0.0, 0.0, -1.0),
    "along_track": (0.0, -1.0, 0.0),
}
"""Direction that the image's down side follows: the Earth, minus the orbit normal, or minus the velocity."""

_DEGENERATE = 1e-4
"""Sine of the angle between boresight and reference below which the reference is degenerate."""


class Pointing(Section, frozen=True, kw_only=True, dict=True):
    """Boresight at the target's centre of mass, then rotated by constant angles.

    ``right_deg`` and ``below_deg`` rotate the boresight to the right of and below the target; ``roll_deg`` rotates the
    camera clockwise about it. ``down`` is the reference for the image's down side; ``auto`` is the first of nadir,
    cross_track, along_track that stays away from the boresight during the flight.
    """

    # until `flight.build.with_best_down` has chosen, auto is nadir; while the boresight is along it, the next of the
    # three replaces it
    down: Literal["auto", "nadir", "cross_track", "along_track"] = "auto"
    right_deg: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    below_deg: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    roll_deg: Degrees = 0.0

    def attitude(
        self, los_eci_m: FloatArray, los_rate_eci_m_s: FloatArray, lvlh: Lvlh
    ) -> tuple[FloatArray, FloatArray]:
        """Return attitude and rate of the camera.

        Parameters
        ----------
        los_eci_m : (3,) array
            Target minus camera, GCRS axes [m].
        los_rate_eci_m_s : (3,) array
            Derivative of the same [m s-1].
        lvlh : Lvlh
            The target's LVLH frame, to which ``down`` refers.

        Returns
        -------
        tuple of array
            ``q_camera_from_eci_wxyz`` (4,) and the rate relative to ECI in the camera frame [rad s-1] (3,).
        """
        z, z_rate = unit_and_rate(los_eci_m, los_rate_eci_m_s)
        down = self._reference(z, lvlh)
        down_rate = cross(lvlh.omega_eci_rad_s, down)
        transverse = down - (down @ z) * z
        transverse_rate = down_rate - (down_rate @ z + down @ z_rate) * z - (down @ z) * z_rate
        y, y_rate = unit_and_rate(transverse, transverse_rate)
        x = cross(y, z)
        x_rate = cross(y_rate, z) + cross(y, z_rate)
        q = quat_from_matrix(np.stack([x, y, z]))
        omega = np.array([y_rate @ z, z_rate @ x, x_rate @ y])
        offset = self._offset
        return quat_multiply(offset, q), matrix_from_quat(offset) @ omega

    def _reference(self, z: FloatArray, lvlh: Lvlh) -> FloatArray:
        first: Down = "nadir" if self.down == "auto" else self.down
        for name in (first, *(other for other in DOWN_AXES_LVLH if other != first)):
            d = lvlh.R_eci_from_lvlh @ np.array(DOWN_AXES_LVLH[name])
            if length(cross(d, z)) > _DEGENERATE:
                break
        return d

    @cached_property
    def _offset(self) -> FloatArray:
        """Quaternion of the constant offset: right about +y, then down about -x, then roll about +z."""
        right = quat_from_rotvec([0.0, np.radians(self.right_deg), 0.0])
        down = quat_from_rotvec([-np.radians(self.below_deg), 0.0, 0.0])
        roll = quat_from_rotvec([0.0, 0.0, np.radians(self.roll_deg)])
        return quat_conjugate(quat_multiply(quat_multiply(right, down), roll))
