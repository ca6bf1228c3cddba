"""Instants: parsed from and formatted to UTC, stored as a two-part Julian date of terrestrial time (TT)."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import erfa

from flyaround.simulator.world.constants import DAY_S
from flyaround.simulator.world.time.earth_parameters import earth_parameters

if TYPE_CHECKING:
    from collections.abc import Callable

_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d(?:\.\d+)?)Z")
_LEAP_SECOND = re.compile(r"(?<=T23:59:)60(\.\d+|)")  # and its fraction
_FIRST_YEAR, _LAST_YEAR = 1972, 2099
"""UTC with whole leap seconds starts in 1972; the Earth's ephemeris (epv00) ends with 2100."""


def without_year_warning(function: Callable[..., Any], *args: Any) -> Any:  # noqa: ANN401 - erfa ships no types
    """Call an erfa routine without its "dubious year" warning.

    erfa warns if a date is more than five years after the release of its table of leap seconds. A leap second announced
    after the release would rotate the Earth by 15 arcsec under the orbit, which is neglected.

    Returns
    -------
    object
        Result of the routine.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)
        return function(*args)


@dataclass(frozen=True)
class Instant:
    """A moment as a two-part Julian date of TT.

    Parameters
    ----------
    tt1 : float
        Large part of the Julian date (TT).
    tt2 : float
        Small part of the Julian date; near one day its float64 resolves 0.01 ns.

    Raises
    ------
    ValueError
        If a part is not finite.
    """

    tt1: float
    tt2: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.tt1 + self.tt2):
            raise ValueError(f"a Julian date of {self.tt1} and {self.tt2} is not finite")

    @staticmethod
    def from_utc(text: str) -> Instant:
        """Parse an instant such as ``2026-03-20T12:00:00Z`` (ISO 8601, with optional fractional seconds).

        Returns
        -------
        Instant
            Instant with its TT and UT1.

        Raises
        ------
        ValueError
            If the text is not of that form, not a date, or outside 1972 to 2099.
        """
        match = _ISO.fullmatch(text)
        if match is None:
            raise ValueError(f"{text!r} is not a UTC time of the form 2026-03-20T12:00:00Z")
        year, month, day, hour, minute = (int(g) for g in match.groups()[:5])
        second = float(match[6])
        if not _FIRST_YEAR <= year <= _LAST_YEAR:
            raise ValueError(f"{text!r} is outside the years {_FIRST_YEAR} to {_LAST_YEAR}")
        leap = (hour, minute) == (23, 59)  # a leap second follows the last one of a day
        if hour > 23 or minute > 59 or second >= (61 if leap else 60):
            raise ValueError(f"{text!r} has an hour, minute or second that does not exist")
        try:
            utc1, utc2 = without_year_warning(erfa.dtf2d, "UTC", year, month, day, hour, minute, second)
        except erfa.ErfaError as error:
            raise ValueError(f"{text!r} is not a date of the calendar") from error
        tt1, tt2 = erfa.taitt(*without_year_warning(erfa.utctai, utc1, utc2))
        return Instant(float(tt1), float(tt2))

    def plus(self, seconds: float) -> Instant:
        """Return the instant ``seconds`` later (SI seconds, across leap seconds).

        Returns
        -------
        Instant
            Later instant; an earlier one for negative ``seconds``.
        """
        return Instant(self.tt1, self.tt2 + seconds / DAY_S)

    def minus(self, earlier: Instant) -> float:
        """Return the seconds from ``earlier`` to this instant.

        Returns
        -------
        float
            SI seconds, leap seconds included; negative if ``earlier`` is later [s].
        """
        return ((self.tt1 - earlier.tt1) + (self.tt2 - earlier.tt2)) * DAY_S

    @property
    def utc(self) -> tuple[float, float]:
        """Two-part quasi Julian date of UTC."""
        utc1, utc2 = without_year_warning(erfa.taiutc, *erfa.tttai(self.tt1, self.tt2))
        return float(utc1), float(utc2)

    @property
    def mjd_utc(self) -> float:
        """Modified Julian date of UTC, the argument of the Earth orientation tables."""
        utc1, utc2 = self.utc
        return utc1 - 2400000.5 + utc2

    @property
    def ut1(self) -> tuple[float, float]:
        """Two-part Julian date of UT1, from the table of measured Earth rotation.

        Outside the table UT1 - TAI is held at its nearest row (see `flyaround.simulator.world.time.earth_parameters`).
        """
        tai1, tai2 = erfa.tttai(self.tt1, self.tt2)
        offset_s = earth_parameters().compute_ut1_minus_tai_s(self.mjd_utc)
        return float(tai1), float(tai2) + offset_s / DAY_S

    @property
    def tdb(self) -> tuple[float, float]:
        """Two-part Julian date of TDB."""
        return self.tt1, self.tt2 + tdb_minus_tt_s(self.tt1, self.tt2) / DAY_S

    def iso(self) -> str:
        """Return ISO 8601 text in UTC with microseconds and a trailing Z.

        Returns
        -------
        str
            Text that `from_utc` parses.
        """
        year, month, day, hmsf = without_year_warning(erfa.d2dtf, "UTC", 6, *self.utc)
        date = f"{int(year):04d}-{int(month):02d}-{int(day):02d}"
        h, m, s, f = (int(hmsf[field]) for field in "hmsf")
        return f"{date}T{h:02d}:{m:02d}:{s:02d}.{f:06d}Z"


def tdb_minus_tt_s(tt1: float, tt2: float) -> float:
    """Return TDB - TT at the Earth's centre [s], at most 1.7 ms, for a two-part Julian date of TT or TDB.

    References
    ----------
    SOFA routine ``iauDtdb`` (Fairhead & Bretagnon 1990: 3 ns).
    """
    return float(erfa.dtdb(tt1, tt2, (tt1 + tt2 + 0.5) % 1.0, 0.0, 0.0, 0.0))


def datetime_utc(epoch_utc: str) -> datetime:
    """Convert an ISO time in UTC to a datetime.

    Returns
    -------
    datetime
        Date and time to the microsecond. A leap second, which a datetime lacks, is the last microsecond before it.

    Raises
    ------
    ValueError
        If the text is not an ISO time.
    """
    return datetime.fromisoformat(_LEAP_SECOND.sub("59.999999", epoch_utc))


def nanoseconds_utc(epoch_utc: str) -> int:
    """Convert an ISO time in UTC to nanoseconds since 1970-01-01, without leap seconds.

    Returns
    -------
    int
        Nanoseconds; the microseconds of the text are exact. A leap second is compressed into the last microsecond
        before it, so that later times never have smaller numbers.

    Raises
    ------
    ValueError
        If the text is not an ISO time.
    """
    time = datetime_utc(epoch_utc)
    seconds = int(time.replace(microsecond=0).timestamp())
    leap = _LEAP_SECOND.search(epoch_utc)
    within_leap_ns = int(1000 * float(f"0{leap[1]}")) if leap else 0
    return seconds * 1_000_000_000 + time.microsecond * 1000 + within_leap_ns
