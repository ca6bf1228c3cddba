"""Orientation of the Earth: precession, nutation, rotation and polar motion between GCRS and ITRS."""

from __future__ import annotations

from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.world.frames.rotation import quat_from_matrix
from flyaround.simulator.world.time.earth_parameters import earth_parameters

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant


def R_itrs_from_eci(instant: Instant, *, polar_motion: bool = True) -> FloatArray:
    """Return the (3, 3) rotation from GCRS to ITRS, IAU 2006/2000A, with measured UT1 and pole where tabulated.

    The celestial pole offsets of the IERS (0.3 mas, 1 cm on the ground) are neglected.

    Parameters
    ----------
    instant : Instant
        Time of the orientation.
    polar_motion : bool, optional
        False to use the Earth's axis as pole (up to 0.6 arcsec, 18 m).

    Returns
    -------
    (3, 3) array
        Rotation matrix.

    References
    ----------
    IERS Conventions (2010), chapter 5; SOFA routine ``iauC2t06a``.
    """
    pole = _pole(instant) if polar_motion else (0.0, 0.0)
    return np.asarray(erfa.c2t06a(instant.tt1, instant.tt2, *instant.ut1, *pole), float)


def celestial_and_polar(instant: Instant) -> tuple[FloatArray, FloatArray]:
    """Return the slow factors of `R_itrs_from_eci`: GCRS to CIRS, and TIRS to ITRS."""
    tt1, tt2 = instant.tt1, instant.tt2
    polar = erfa.pom00(*_pole(instant), erfa.sp00(tt1, tt2))
    return np.asarray(erfa.c2i06a(tt1, tt2), float), np.asarray(polar, float)


def q_itrs_from_eci(instant: Instant) -> FloatArray:
    """Return `R_itrs_from_eci` with polar motion as a unit quaternion.

    Returns
    -------
    (4,) array
        Quaternion ``q_itrs_from_eci``, Hamilton, scalar first, ``w >= 0``.
    """
    return quat_from_matrix(R_itrs_from_eci(instant))


def pole_eci(instant: Instant) -> FloatArray:
    """Return the unit vector along the Earth's axis (the celestial intermediate pole) in GCRS."""
    return celestial_and_polar(instant)[0][2]


def _pole(instant: Instant) -> tuple[float, float]:
    return earth_parameters().compute_pole_rad(instant.mjd_utc)
