"""Orientation of the Moon, by the series of the IAU for its pole and rotation angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.ephemeris.body import R_fixed_from_pole
from flyaround.simulator.world.frames.rotation import quat_from_matrix

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

# arguments E1 to E13: value at J2000.0 [deg] and rate [deg per day]
_ARGUMENTS = np.array(
    [
        (125.045, -0.0529921),
        (250.089, -0.1059842),
        (260.008, 13.0120009),
        (176.625, 13.3407154),
        (357.529, 0.9856003),
        (311.589, 26.4057084),
        (134.963, 13.0649930),
        (276.617, 0.3287146),
        (34.226, 1.7484877),
        (15.134, -0.1589763),
        (119.743, 0.0036096),
        (239.961, 0.1643573),
        (25.053, 12.9590088),
    ]
)
# amplitudes [deg] of the arguments' sines in right ascension of the pole, cosines in declination, and sines in W
_ALPHA = np.array([-3.8787, -0.1204, 0.0700, -0.0172, 0, 0.0072, 0, 0, 0, -0.0052, 0, 0, 0.0043])
_DELTA = np.array([1.5419, 0.0239, -0.0278, 0.0068, 0, -0.0029, 0.0009, 0, 0, 0.0008, 0, 0, -0.0009])
_W = np.array(
    [
        3.5610, 0.1208, -0.0642, 0.0158, 0.0252, -0.0066, -0.0047,
        -0.0046, 0.0028, 0.0052, 0.0040, 0.0019, -0.0044,
    ]
)  # fmt: skip


def R_moon_from_eci(instant: Instant) -> FloatArray:
    """Return the (3, 3) rotation from GCRS to the Moon's mean Earth / polar axis frame.

    The x axis points to the mean Earth (longitude 0), z along the rotation axis. The error is up to 150 m on the
    surface.

    References
    ----------
    Archinal et al. (2011), Report of the IAU Working Group on Cartographic Coordinates and Rotational Elements:
    2009, Celest. Mech. Dyn. Astr. 109, table 2.
    """
    days = instant.tt1 - 2451545.0 + instant.tt2
    centuries = days / 36525.0
    E = np.radians(_ARGUMENTS[:, 0] + _ARGUMENTS[:, 1] * days)
    alpha = 269.9949 + 0.0031 * centuries + float(_ALPHA @ np.sin(E))
    delta = 66.5392 + 0.0130 * centuries + float(_DELTA @ np.cos(E))
    W = 38.3213 + 13.17635815 * days - 1.4e-12 * days**2 + float(_W @ np.sin(E))
    return R_fixed_from_pole(alpha, delta, W)


def q_moon_from_eci(instant: Instant) -> FloatArray:
    """Return the unit quaternion ``q_moon_from_eci_wxyz``, scalar first."""
    return quat_from_matrix(R_moon_from_eci(instant))
