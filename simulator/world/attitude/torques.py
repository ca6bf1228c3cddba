"""What turns the target: a torque fixed in its axes, gravity's gradient, its residual magnetic moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.runtime.arrays import Vec3
from simulator.world.attitude.magnetic import magnetic_field_t
from simulator.world.constants import MU_EARTH_M3_S2
from simulator.world.ephemeris.ephemeris_table import SkyTable
from simulator.world.frames.vectors import cross, length

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.runtime.arrays import FloatArray
    from simulator.world.attitude.rigid_body import Torque
    from simulator.world.orbit.propagation import OrbitTrack
    from simulator.world.time.instant import Instant

_J2000 = 2451545.0
_YEAR_DAYS = 365.25


@dataclass(frozen=True, kw_only=True)
class Torques:
    """What acts on the target.

    Parameters
    ----------
    constant_nm : fixed in the body, such as a leak's [N m].
    gravity_gradient : whether the central body turns it.
    residual_dipole_a_m2 : magnetic moment fixed in the body, in the Earth's field [A m2].
    """

    constant_nm: Vec3 = (0.0, 0.0, 0.0)
    gravity_gradient: bool = False
    residual_dipole_a_m2: Vec3 = (0.0, 0.0, 0.0)


NO_TORQUES = Torques()
"""A free tumble."""


def torque_on(torques: Torques, orbit: OrbitTrack, inertia_kg_m2: ArrayLike, epoch: Instant) -> Torque | None:
    """The torque on a body along its orbit, or None when there is none.

    Parameters
    ----------
    torques : what acts. orbit : gives the position. inertia_kg_m2 : (3, 3), body axes. epoch : of the orbit's start.
    """
    J, fixed = np.asarray(inertia_kg_m2, float), np.array(torques.constant_nm, float)
    dipole = np.array(torques.residual_dipole_a_m2, float)
    magnetic = bool(dipole.any())
    if not (torques.gravity_gradient or magnetic):
        return (lambda _t, _R: fixed) if fixed.any() else None
    sky = SkyTable.of(epoch, orbit.duration_s) if magnetic else None
    year = 2000.0 + (epoch.tt1 + epoch.tt2 - _J2000) / _YEAR_DAYS

    def torque(t_s: float, R_eci_from_body: FloatArray) -> FloatArray:
        r, _ = orbit(t_s)
        R_body_from_eci = R_eci_from_body.T
        total = fixed
        if torques.gravity_gradient:
            total = total + gravity_gradient_torque(r, R_body_from_eci, J, orbit.forces.mu_m3_s2)
        if sky is not None:
            R_itrs_from_eci = sky.at(t_s)[0]
            field = R_itrs_from_eci.T @ magnetic_field_t(R_itrs_from_eci @ r, year)
            total = total + cross(dipole, R_body_from_eci @ field)
        return total

    return torque


def gravity_gradient_torque(
    r_eci_m: FloatArray,
    R_body_from_eci: FloatArray,
    inertia_kg_m2: FloatArray,
    mu_m3_s2: float = MU_EARTH_M3_S2,
) -> FloatArray:
    """Torque of a central gravity field on a rigid body, in the body frame [N m].

    Parameters
    ----------
    r_eci_m : (3,) body's position from the attracting centre, GCRS [m].
    R_body_from_eci : (3, 3) rotation.
    inertia_kg_m2 : (3, 3) about the centre of mass, body frame.
    mu_m3_s2 : gravitational parameter.

    References
    ----------
    Wertz (1978), Spacecraft Attitude Determination and Control, eq. 17-33.
    """
    r = length(r_eci_m)
    up = R_body_from_eci @ r_eci_m / r
    return np.asarray(3 * mu_m3_s2 / r**3 * cross(up, inertia_kg_m2 @ up))
