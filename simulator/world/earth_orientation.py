"""Orientation of the Earth: precession, nutation and rotation between GCRS and ITRS."""

from __future__ import annotations

from typing import TYPE_CHECKING

import erfa
import numpy as np

from simulator.world.rotation import quat_from_matrix

if TYPE_CHECKING:
    from simulator.arrays import FloatArray
    from simulator.world.time import Instant


def R_itrs_from_eci(instant: Instant) -> FloatArray:
    """(3, 3) rotation from GCRS to ITRS, IAU 2006/2000A, without polar motion (0.3 arcsec, 10 m).

    References
    ----------
    IERS Conventions (2010), chapter 5; SOFA routine ``iauC2t06a``.
    """
    return np.asarray(erfa.c2t06a(instant.tt1, instant.tt2, *instant.ut1, 0.0, 0.0), float)


def q_itrs_from_eci(instant: Instant) -> FloatArray:
    """Unit quaternion ``q_itrs_from_eci_wxyz``, scalar first."""
    return quat_from_matrix(R_itrs_from_eci(instant))


def pole_eci(instant: Instant) -> FloatArray:
    """Unit vector along the Earth's axis (celestial intermediate pole) in GCRS."""
    return R_itrs_from_eci(instant)[2]
