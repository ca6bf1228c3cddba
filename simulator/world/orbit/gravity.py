"""Plain gravity of a body: a point mass with the oblateness term J2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.constants import EARTH_RADIUS_M, J2_EARTH, MU_EARTH_M3_S2

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.time.instant import Instant


@dataclass(frozen=True)
class Gravity:
    """Two-body gravity with J2.

    Parameters
    ----------
    j2 : float, optional
        Second zonal harmonic; 0 gives the two-body problem.
    pole_eci : array, optional
        Unit vector along the body's axis of symmetry, constant over a flight (the Earth's moves 20 arcsec a year).
    mu_m3_s2 : float, optional
        Gravitational parameter.
    radius_m : float, optional
        Reference radius of ``j2``.
    """

    solar_pressure: ClassVar[bool] = False
    j2: float = J2_EARTH
    pole_eci: Vec3 = (0.0, 0.0, 1.0)
    mu_m3_s2: float = MU_EARTH_M3_S2
    radius_m: float = EARTH_RADIUS_M

    @staticmethod
    def from_body(body: Body, epoch: Instant) -> Gravity:
        """Return the gravity of a body, symmetric about its pole at ``epoch``.

        Returns
        -------
        Gravity
            Point mass and J2 of the body; its pole stays that of ``epoch``.
        """
        return Gravity(body.j2, vec3(body.pole_eci(epoch)), body.mu_m3_s2, body.radius_m)

    def acceleration(self, r_eci_m: FloatArray) -> FloatArray:
        """Compute the acceleration at a position (3,) from the body's centre, GCRS axes.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].

        References
        ----------
        Vallado (2013), Fundamentals of Astrodynamics (J2), written for any pole.
        """
        # scalar arithmetic: NumPy's overhead on three numbers would dominate the integration
        x, y, z = r_eci_m.tolist()
        px, py, pz = self.pole_eci
        r2 = x * x + y * y + z * z
        along_pole = x * px + y * py + z * pz
        central = -self.mu_m3_s2 / (r2 * r2**0.5)
        k = 1.5 * self.j2 * self.radius_m**2 / r2
        radial = central * (1 + k * (1 - 5 * along_pole * along_pole / r2))
        polar = 2 * central * k * along_pole
        return np.array([radial * x + polar * px, radial * y + polar * py, radial * z + polar * pz])

    def target(self, _t_s: float, r_eci_m: FloatArray, _v_eci_m_s: FloatArray) -> FloatArray:
        """Compute the acceleration of the target by `acceleration`.

        Returns
        -------
        (3,) array
            Acceleration, GCRS axes [m s-2].
        """
        return self.acceleration(r_eci_m)

    def pair(
        self,
        _t_s: float,
        r_eci_m: FloatArray,
        _v_eci_m_s: FloatArray,
        p_eci_m: FloatArray,
        _w_eci_m_s: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the acceleration of the target, and that of the chaser relative to it.

        Returns
        -------
        tuple of array
            Acceleration (3,) of the target, and chaser minus target (3,), GCRS axes [m s-2]. The latter is the
            difference of two rounded accelerations, exact to 1e-15 m s-2.
        """
        a = self.acceleration(r_eci_m)
        return a, self.acceleration(r_eci_m + p_eci_m) - a

    def potential(self, r_eci_m: FloatArray) -> float:
        """Compute the potential energy per unit mass at a position (3,) from the body's centre, GCRS axes.

        Returns
        -------
        float
            Potential [J kg-1], negative, zero at infinity.
        """
        r = float(np.linalg.norm(r_eci_m))
        sin_latitude = float(np.dot(r_eci_m, self.pole_eci)) / r
        oblate = self.j2 * (self.radius_m / r) ** 2 * (3 * sin_latitude**2 - 1) / 2
        return -self.mu_m3_s2 / r * (1 - oblate)
