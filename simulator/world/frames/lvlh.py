"""The local-vertical local-horizontal (Hill) frame: x radial outward, y along-track, z cross-track."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.frames.vectors import cross, cross_product, dot_product

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Lvlh:
    """The LVLH frame at one time.

    Parameters
    ----------
    R_eci_from_lvlh : (3, 3) array
        Rotation; its columns are the radial, along-track and cross-track axes.
    omega_eci_rad_s : (3,) array
        Rate of the frame relative to GCRS, along GCRS axes [rad s-1].
    """

    R_eci_from_lvlh: FloatArray
    omega_eci_rad_s: FloatArray

    def to_eci(self, p_lvlh: FloatArray, v_lvlh: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Convert relative position and velocity from the rotating LVLH frame to GCRS axes.

        Returns
        -------
        p_eci : (3,) array
            Position along GCRS axes, in the unit of ``p_lvlh``.
        v_eci : (3,) array
            Its derivative in GCRS: the velocity in the frame, plus that of the frame's rotation at ``p_eci``.
        """
        p = self.R_eci_from_lvlh @ p_lvlh
        return p, self.R_eci_from_lvlh @ v_lvlh + cross(self.omega_eci_rad_s, p)

    def from_eci(self, p_eci: FloatArray, v_eci: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Convert relative position and velocity from GCRS axes to the rotating LVLH frame.

        Returns
        -------
        p_lvlh : (3,) array
            Position along LVLH axes, in the unit of ``p_eci``.
        v_lvlh : (3,) array
            Its derivative in the rotating frame, zero for a point at rest in LVLH.
        """
        R = self.R_eci_from_lvlh.T
        return R @ p_eci, R @ (v_eci - cross(self.omega_eci_rad_s, p_eci))


def lvlh_frame(r_eci_m: FloatArray, v_eci_m_s: FloatArray, a_eci_m_s2: FloatArray) -> Lvlh:
    """Compute the LVLH frame of a spacecraft.

    The angular velocity is exact for the given acceleration. It is ``h / r^2`` about the cross-track axis, plus the
    rotation of the orbit plane about the radial axis by the out-of-plane acceleration.

    Parameters
    ----------
    r_eci_m : (3,) array
        Position from the central body, GCRS axes [m].
    v_eci_m_s : (3,) array
        Velocity, GCRS axes [m s-1].
    a_eci_m_s2 : (3,) array
        Acceleration, GCRS axes [m s-2].

    Returns
    -------
    Lvlh
        Rotation from GCRS, and angular velocity [rad s-1].

    Raises
    ------
    ValueError
        If position and velocity span no plane: one is zero, or they are parallel.

    References
    ----------
    Alfriend et al. (2010), Spacecraft Formation Flying, chapter 4.
    """
    r, v = r_eci_m.tolist(), v_eci_m_s.tolist()
    h = cross_product(r, v)
    r_norm, h_norm = math.sqrt(dot_product(r, r)), math.sqrt(dot_product(h, h))
    if not h_norm > 0:  # NaN too
        raise ValueError(f"position {r} and velocity {v} span no orbit plane")
    x, z = [c / r_norm for c in r], [c / h_norm for c in h]
    y = cross_product(z, x)
    plane_rate = r_norm * dot_product(a_eci_m_s2.tolist(), z) / h_norm
    rate = h_norm / r_norm**2
    omega = [rate * c + plane_rate * d for c, d in zip(z, x, strict=True)]
    return Lvlh(np.array([x, y, z]).T, np.array(omega))
