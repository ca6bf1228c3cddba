"""Two-line elements: reading, checks, and propagation by SGP4 to a state in GCRS."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import erfa
import numpy as np
from sgp4.api import SGP4_ERRORS, Satrec

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.ephemeris.earth_orientation import celestial_and_polar
from flyaround.simulator.world.time.instant import Instant, without_year_warning

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

_MAX_AGE_DAYS = 30.0
"""Age above which an element set is refused, because SGP4's error grows by a kilometre or more per day."""
_LINE_LENGTH = 69  # characters per line
_DATA_LINE = re.compile(r"[12] [0-9A-Z ][0-9 ]{4}")


def state_from_tle(line1: str, line2: str, epoch: Instant) -> tuple[FloatArray, FloatArray]:
    """Propagate two-line elements to ``epoch`` by SGP4.

    Returns
    -------
    r_eci_m : (3,) array
        Position from the Earth's centre, GCRS axes [m].
    v_eci_m_s : (3,) array
        Velocity, GCRS axes [m s-1].

    Raises
    ------
    UserError
        If a line is malformed, a checksum is wrong, the epoch is more than 30 days away, or SGP4 fails.
    """
    for number, line in ((1, line1), (2, line2)):
        check_line(line, number)
    if line1[2:7] != line2[2:7]:
        raise UserError(f"the two lines are of satellites {line1[2:7]} and {line2[2:7]}: give lines of one")
    try:
        satellite = Satrec.twoline2rv(line1, line2)
    except ValueError as error:
        raise UserError(f"the two-line elements cannot be read: {error}: copy them again") from error
    return sgp4_state(satellite, epoch, "the two-line elements")


def sgp4_state(satellite: Satrec, epoch: Instant, description: str) -> tuple[FloatArray, FloatArray]:
    """Return position [m] and velocity [m s-1] in GCRS at ``epoch``.

    SGP4's frame is the true equator and mean equinox of date (TEME). It is rotated to GCRS by the difference between
    Greenwich mean sidereal time (1982) and the Earth rotation angle, and by IAU 2006/2000A.

    Parameters
    ----------
    satellite : Satrec
        Mean elements.
    epoch : Instant
        Time of the state, at most 30 days from the elements'.
    description : str
        Their name in messages.

    Returns
    -------
    tuple of array
        Position (3,) [m] and velocity (3,) [m s-1].

    Raises
    ------
    UserError
        If the epoch is too far away, or SGP4 fails or gives no orbit.

    References
    ----------
    Vallado, Crawford, Hujsak & Kelso (2006), Revisiting Spacetrack Report #3, AIAA 2006-6753.
    """
    utc1, utc2 = epoch.utc
    days = (utc1 - satellite.jdsatepoch) + (utc2 - satellite.jdsatepochF)
    # also NaN
    if not abs(days) <= _MAX_AGE_DAYS:
        raise UserError(
            f"{description} are {abs(days):.0f} days {'older' if days > 0 else 'newer'} than the epoch, "
            f"allowed: at most {_MAX_AGE_DAYS:.0f}; take a fresher set or change epoch_utc"
        )
    error, r_km, v_km_s = satellite.sgp4(utc1, utc2)
    if error:
        raise UserError(
            f"SGP4 cannot propagate {description} to the epoch: {SGP4_ERRORS[error]}: use a set closer to it"
        )
    problem = EARTH.distance_problem(float(np.linalg.norm(r_km)) * 1e3)
    if problem or not np.isfinite(v_km_s).all():
        raise UserError(
            f"SGP4 propagates {description} over {abs(days):.1f} days to a position that "
            f"{problem or 'is not finite'}: use a set closer to the epoch"
        )
    R = R_eci_from_teme(epoch)
    return R @ np.array(r_km) * 1e3, R @ np.array(v_km_s) * 1e3


@dataclass(frozen=True)
class ElementSet:
    """Two lines of one satellite, and its name if the file has one."""

    name: str
    line1: str
    line2: str

    @property
    def number(self) -> str:
        """Catalogue number, without leading zeros."""
        return self.line1[2:7].strip().lstrip("0")


def read_element_sets(text: str, source: str) -> list[ElementSet]:
    """Read a file of two-line elements, each set optionally preceded by a name line, which may begin with ``0``.

    Returns
    -------
    list of ElementSet
        At least one, in the order of the file; the name is empty where a set has no name line.

    Raises
    ------
    UserError
        If a line is malformed or unpaired.
    """
    sets: list[ElementSet] = []
    name, first_line = "", ""
    for line_number, raw in enumerate(text.splitlines(), start=1):
        line = raw.rstrip()
        location = f"{source}, line {line_number}"
        if not line or line.startswith("#"):
            continue
        digit = line[0] if _DATA_LINE.match(line) else ""
        if first_line and digit != "2":
            raise UserError(f"{location}: line 2 of the two-line elements is missing: copy the set again")
        if digit == "2" and not first_line:
            raise UserError(
                f"{location}: line 1 of the two-line elements is missing before it: copy the set again"
            )
        if not digit:
            if name:
                raise UserError(
                    f"{location}: {name[:30]!r} is not followed by two lines of elements: "
                    "is this a file of two-line elements?"
                )
            name = line.removeprefix("0 ").strip()
            continue
        try:
            check_line(line, int(digit))
        except UserError as error:
            raise UserError(f"{location}: {error}") from error
        if digit == "1":
            first_line = line
            continue
        sets.append(ElementSet(name, first_line, line))
        name, first_line = "", ""
    if first_line or not sets:
        raise UserError(f"{source} has no two lines of elements: copy the set again")
    return sets


def is_element_file(text: str) -> bool:
    """Return True if one of the first lines of a text looks like line 1 of two-line elements.

    Returns
    -------
    bool
        True if one of the first 20 lines starts like line 1; checksums are not tested.
    """
    return any(_DATA_LINE.match(line) and line[0] == "1" for line in text.splitlines()[:20])


def choose_set(sets: Sequence[ElementSet], satellite: str | None, source: str) -> ElementSet:
    """Return the only set, or the one selected by name or catalogue number.

    Returns
    -------
    ElementSet
        The set whose name (in any case) or catalogue number (leading zeros do not count) is ``satellite``.

    Raises
    ------
    UserError
        If there are several and none is selected, or the selection is missing or ambiguous.
    """
    available = ", ".join(f"{s.name or 'without a name'} ({s.number})" for s in sets[:10])
    available += f" and {len(sets) - 10} more" if len(sets) > 10 else ""
    if satellite is not None:
        name = satellite.strip().upper()
        selected = [s for s in sets if name.lstrip("0") == s.number.upper() or name == s.name.upper()]
        if not selected:
            raise UserError(f"{source} has no satellite {satellite!r}: it has {available}")
        sets = selected
    if len(sets) > 1:
        raise UserError(
            f"{source} has {len(sets)} sets of elements: choose one by key orbit.satellite, or keep one, of {available}"
        )
    return sets[0]


def R_eci_from_teme(epoch: Instant) -> FloatArray:
    """Return the rotation to GCRS from the true equator and mean equinox of date.

    Returns
    -------
    (3, 3) array
        Rotation matrix.
    """
    ut1 = epoch.ut1
    angle = float(without_year_warning(erfa.gmst82, *ut1)) - float(erfa.era00(*ut1))
    c, s = np.cos(angle), np.sin(angle)
    R_cirs_from_teme = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(celestial_and_polar(epoch)[0].T @ R_cirs_from_teme)


def check_line(line: str, number: int) -> None:
    """Check number, length and checksum of a line.

    Parameters
    ----------
    line : str
        Line 1 or 2 of two-line elements.
    number : int
        1 or 2.

    Raises
    ------
    UserError
        If one of them is wrong.
    """
    is_plain = line.isascii() and len(line) == _LINE_LENGTH
    if not is_plain or not line.startswith(f"{number} ") or not line[-1].isdigit():
        raise UserError(
            f"line {number} of the two-line elements is {line!r}, allowed: {_LINE_LENGTH} characters, all ASCII, that "
            f"start with {number} and end with a checksum"
        )
    checksum = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10
    if checksum != int(line[-1]):
        raise UserError(
            f"line {number} of the two-line elements has checksum {line[-1]}, its characters add up to "
            f"{checksum}: copy it again"
        )
