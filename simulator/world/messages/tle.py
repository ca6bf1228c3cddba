"""Two-line elements: checked, then carried to the epoch by SGP4 and turned into GCRS."""

from __future__ import annotations

from typing import TYPE_CHECKING

import erfa
import numpy as np
from sgp4.api import SGP4_ERRORS, Satrec

from simulator.errors import UserError
from simulator.world.ephemeris.earth_orientation import celestial_and_polar
from simulator.world.time.instant import Instant, without_year_warning

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray

_FAR_DAYS = 30.0
"""SGP4 loses a kilometre or more a day; a month from its epoch an element set says little."""
_LINE = 69


def state_from_tle(line1: str, line2: str, epoch: Instant) -> tuple[FloatArray, FloatArray]:
    """Position [m] and velocity [m s-1] in GCRS at ``epoch``.

    SGP4 speaks of the true equator and mean equinox of date (TEME); the Earth's rotation links it to GCRS:
    Greenwich mean sidereal time 1982 on one side, IAU 2006 on the other.

    Raises
    ------
    UserError
        If a line is malformed, a checksum is wrong, the epoch is more than 30 days away, or SGP4 gives up.

    References
    ----------
    Vallado, Crawford, Hujsak & Kelso (2006), Revisiting Spacetrack Report #3, AIAA 2006-6753.
    """
    for number, line in ((1, line1), (2, line2)):
        check_line(line, number)
    if line1[2:7] != line2[2:7]:
        raise UserError(f"the two lines are of satellites {line1[2:7]} and {line2[2:7]}: give lines of one")
    satellite = Satrec.twoline2rv(line1, line2)
    utc1, utc2 = epoch.utc
    days = (utc1 - satellite.jdsatepoch) + (utc2 - satellite.jdsatepochF)
    if abs(days) > _FAR_DAYS:
        raise UserError(
            f"the two-line elements are {abs(days):.0f} days {'older' if days > 0 else 'newer'} than the epoch, "
            f"allowed: at most {_FAR_DAYS:.0f}; take a fresher set or change epoch_utc"
        )
    error, r_km, v_km_s = satellite.sgp4(utc1, utc2)
    if error:
        raise UserError(f"SGP4 cannot carry the two-line elements to the epoch: {SGP4_ERRORS[error]}")
    R = R_eci_from_teme(epoch)
    return R @ np.array(r_km) * 1e3, R @ np.array(v_km_s) * 1e3


def R_eci_from_teme(epoch: Instant) -> FloatArray:
    """(3, 3) rotation to GCRS from the true equator and mean equinox of date."""
    ut1 = epoch.ut1
    angle = float(without_year_warning(erfa.gmst82, *ut1)) - float(erfa.era00(*ut1))
    c, s = np.cos(angle), np.sin(angle)
    R_cirs_from_teme = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(celestial_and_polar(epoch)[0].T @ R_cirs_from_teme)


def check_line(line: str, number: int) -> None:
    """Refuse a line whose number, length or checksum is wrong.

    Raises
    ------
    UserError
        Saying which.
    """
    if len(line) != _LINE or not line.startswith(f"{number} ") or not line[-1].isdigit():
        raise UserError(
            f"line {number} of the two-line elements is {line!r}, allowed: {_LINE} characters that start with "
            f"{number} and end with a checksum"
        )
    checksum = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10
    if checksum != int(line[-1]):
        raise UserError(
            f"line {number} of the two-line elements has checksum {line[-1]}, its characters add up to "
            f"{checksum}: copy it again"
        )
