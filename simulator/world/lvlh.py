"""The local-vertical local-horizontal (Hill) frame: x radial outward, y along-track, z cross-track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Lvlh:
    """The frame at one moment.

    Parameters
    ----------
    R_eci_from_lvlh : (3, 3) rotation; its columns are the radial, along-track and cross-track axes.
    omega_eci_rad_s : (3,) rate of the frame relative to GCRS, along GCRS axes [rad s-1].
    """

    R_eci_from_lvlh: FloatArray
    omega_eci_rad_s: FloatArray

    def to_eci(self, p_lvlh: FloatArray, v_lvlh: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative position and velocity of LVLH along GCRS axes (the frame's rotation added)."""
        p = self.R_eci_from_lvlh @ p_lvlh
        return p, self.R_eci_from_lvlh @ v_lvlh + np.cross(self.omega_eci_rad_s, p)

    def from_eci(self, p_eci: FloatArray, v_eci: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative position and velocity as seen in the rotating LVLH frame."""
        R = self.R_eci_from_lvlh.T
        return R @ p_eci, R @ (v_eci - np.cross(self.omega_eci_rad_s, p_eci))


def lvlh_frame(r_eci_m: FloatArray, v_eci_m_s: FloatArray, a_eci_m_s2: FloatArray) -> Lvlh:
    """LVLH of a spacecraft at ``r_eci_m`` moving with ``v_eci_m_s`` under ``a_eci_m_s2``.

    The rate is exact for the given acceleration: ``h/r^2`` about the cross-track axis, and the turning of the
    orbit plane by the out-of-plane acceleration about the radial axis.

    References
    ----------
    Alfriend et al. (2010), Spacecraft Formation Flying, sec. 4.1.
    """
    h = np.cross(r_eci_m, v_eci_m_s)
    r_norm, h_norm = float(np.linalg.norm(r_eci_m)), float(np.linalg.norm(h))
    x, z = r_eci_m / r_norm, h / h_norm
    y = np.cross(z, x)
    out_of_plane = float(a_eci_m_s2 @ z)
    omega = h_norm / r_norm**2 * z + r_norm * out_of_plane / h_norm * x
    return Lvlh(np.column_stack([x, y, z]), omega)
