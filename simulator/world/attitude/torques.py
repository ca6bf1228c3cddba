"""Torques on a rigid body in orbit: constant in body axes, gravity gradient, and residual magnetic dipole."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.frames.vectors import cross, length

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.attitude.rigid_body import Torque
    from flyaround.simulator.world.orbit.propagation import OrbitTrack
    from flyaround.simulator.world.time.instant import Instant

_J2000 = 2451545.0  # Julian date of the epoch J2000.0
_YEAR_DAYS = 365.25  # a Julian year
_FIELD_RADIUS_M = 6_371_200.0  # reference radius of IGRF
_DIPOLE_2025_T = np.array([-1410.3, 4545.5, -29350.0]) * 1e-9  # IGRF-14 coefficients g11, h11, g10 at 2025.0
_SECULAR_VARIATION_T_YEAR = np.array([10.0, -21.5, 12.6]) * 1e-9  # their secular variation, per year


def body_torque(
    orbit: OrbitTrack,
    inertia_kg_m2: ArrayLike,
    epoch: Instant,
    *,
    constant_nm: Vec3 = (0.0, 0.0, 0.0),
    gravity_gradient: bool = False,
    residual_dipole_a_m2: Vec3 = (0.0, 0.0, 0.0),
) -> Torque | None:
    """Return the torque on a body along its orbit, or None if there is none.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the body.
    inertia_kg_m2 : array_like
        (3, 3) inertia about the centre of mass, body axes.
    epoch : Instant
        Start of the orbit.
    constant_nm : array, optional
        Torque constant in body axes, for example from a leak [N m].
    gravity_gradient : bool, optional
        True to include the gravity-gradient torque of the central body.
    residual_dipole_a_m2 : array, optional
        Residual magnetic dipole moment, body axes, which acts in the Earth's field [A m2].

    Returns
    -------
    Torque or None
        Function of time [s] and the rotation ``R_eci_from_body``: torque (3,) in body axes [N m].
    """
    J, fixed = np.asarray(inertia_kg_m2, float), np.array(constant_nm, float)
    dipole = np.array(residual_dipole_a_m2, float)
    magnetic = bool(dipole.any())
    if not (gravity_gradient or magnetic):
        return (lambda _t, _R: fixed) if fixed.any() else None
    sky = EphemerisTable.build(epoch, orbit.duration_s) if magnetic else None
    year = 2000.0 + (epoch.tt1 + epoch.tt2 - _J2000) / _YEAR_DAYS

    def torque(t_s: float, R_eci_from_body: FloatArray) -> FloatArray:
        r, _ = orbit(t_s)
        R_body_from_eci = R_eci_from_body.T
        total = fixed
        if gravity_gradient:
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
    """Return the gravity-gradient torque (3,) on a rigid body, body frame [N m].

    Parameters
    ----------
    r_eci_m : (3,) array
        Position of the body from the attracting centre, GCRS [m].
    R_body_from_eci : (3, 3) array
        Rotation.
    inertia_kg_m2 : (3, 3) array
        Inertia about the centre of mass, body frame.
    mu_m3_s2 : float, optional
        Gravitational parameter.

    Raises
    ------
    ValueError
        If ``r_eci_m`` is zero or not finite.

    References
    ----------
    Wertz (1978), Spacecraft Attitude Determination and Control (gravity gradient).
    """
    r = length(r_eci_m)
    if not 0 < r < math.inf:
        raise ValueError(
            f"the position from the attracting centre is {r_eci_m.tolist()}, allowed: finite, not zero"
        )
    up = R_body_from_eci @ r_eci_m / r  # unit vector, body axes
    return np.asarray(3 * mu_m3_s2 / r**3 * cross(up, inertia_kg_m2 @ up))


def magnetic_field_t(r_itrs_m: FloatArray, julian_year: float) -> FloatArray:
    """Return the magnetic flux density of the Earth's tilted dipole, in Earth-fixed axes (3,) [T].

    Only the terms of degree 1 are included. In low orbit the error is up to 30 %, largest over the South Atlantic.

    Parameters
    ----------
    r_itrs_m : (3,) array
        Earth-fixed position.
    julian_year : float
        Date of the field, for example 2025.5.

    References
    ----------
    IAGA (2024), International Geomagnetic Reference Field, 14th generation: g11, h11, g10 at 2025.0 and their secular
    variation. Wertz (1978), Spacecraft Attitude Determination and Control, appendix on the magnetic field.
    """
    moment = _DIPOLE_2025_T + _SECULAR_VARIATION_T_YEAR * (julian_year - 2025.0)
    r = float(np.linalg.norm(r_itrs_m))
    up = r_itrs_m / r
    return np.asarray((_FIELD_RADIUS_M / r) ** 3 * (3 * float(moment @ up) * up - moment))
