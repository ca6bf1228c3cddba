"""The Earth's magnetic field as a tilted dipole at its centre, for the torque on a residual moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray

_RADIUS_M = 6_371_200.0
_DIPOLE_2025_T = np.array([-1410.3, 4545.5, -29350.0]) * 1e-9
_CHANGE_T_YEAR = np.array([10.0, -21.5, 12.6]) * 1e-9


def magnetic_field_t(r_itrs_m: FloatArray, julian_year: float) -> FloatArray:
    """Flux density at (3,) Earth-fixed position, along Earth-fixed axes (3,) [T].

    Degree 1 alone: within 30 % of the whole field in low orbit, worst over the South Atlantic.

    References
    ----------
    IAGA (2024), International Geomagnetic Reference Field, 14th generation: g11, h11, g10 of 2025.0 and their
    change a year. Wertz (1978), Spacecraft Attitude Determination and Control, eq. H-16.
    """
    moment = _DIPOLE_2025_T + _CHANGE_T_YEAR * (julian_year - 2025.0)
    r = float(np.linalg.norm(r_itrs_m))
    up = r_itrs_m / r
    return np.asarray((_RADIUS_M / r) ** 3 * (3 * float(moment @ up) * up - moment))
