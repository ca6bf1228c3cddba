"""Common parts of CCSDS navigation messages: key = value lines, blocks, numbers, times."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.world.constants import DAY_S
from flyaround.simulator.world.time.instant import Instant, tdb_minus_tt_s, without_year_warning

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

_TT_MINUS_SYSTEM_S = {"TAI": 32.184, "TT": 0.0, "GPS": 51.184}
TIME_SYSTEMS = ("UTC", *_TT_MINUS_SYSTEM_S, "TDB")
_GAP_FACTOR = 5.0
"""A gap is a spacing of lines larger than the median spacing times this factor. Nothing is interpolated across it."""
_GAP_NEIGHBOURS = 5  # number of spacings on either side from which the median is taken
_TIME = re.compile(r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))T(\d\d):(\d\d)(?::(\d\d(?:\.\d*)?))?Z?")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
HEADER_KEYS = ("CREATION_DATE", "ORIGINATOR", "CLASSIFICATION", "MESSAGE_ID", "COMMENT")
VERSIONS = ("1.0", "2.0", "3.0")
_META_KEYS = (
    *("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME"),
    *("USEABLE_START_TIME", "USEABLE_STOP_TIME", "INTERPOLATION_DEGREE"),
)
META_KEYS = {
    "OEM": (*_META_KEYS, "REF_FRAME", "REF_FRAME_EPOCH", "INTERPOLATION"),
    "AEM": (
        *(*_META_KEYS, "REF_FRAME_A", "REF_FRAME_B", "ATTITUDE_DIR", "ATTITUDE_TYPE", "QUATERNION_TYPE"),
        *("EULER_ROT_SEQ", "RATE_FRAME", "ANGVEL_FRAME", "INTERPOLATION_METHOD"),
    ),
}
"""Keys of the metadata of an ephemeris, CCSDS 502.0-B-3 table 5-3 and 504.0-B-2 table 4-3."""


def number(text: str, source: str) -> float:
    """Read a finite number, also with Fortran's exponent D.

    Raises
    ------
    UserError
        If it is not one.
    """
    value = float(text.upper().replace("D", "E")) if _NUMBER.fullmatch(text) else np.nan
    if not np.isfinite(value):
        raise UserError(f"{source}: {text[:40]!r} is not a number, a finite one is needed")
    return value


def refuse_unknown_key(key: str, allowed: Sequence[str], source: str) -> None:
    """Check that a key may occur in a block.

    Parameters
    ----------
    key : str
        Key to check.
    allowed : sequence of str
        Keys of the block.
    source : str
        File and line, for messages.

    Raises
    ------
    UserError
        If it may not; the message suggests the nearest allowed key.
    """
    if key in allowed:
        return
    if key.upper() in allowed:
        raise UserError(f"{source}: key {key} is not in upper case, as CCSDS keys are: write {key.upper()}")
    suggestions = near_names(key.upper(), allowed)
    hint = f"did you mean {suggestions[0]}?" if suggestions else "remove it, or export the file again"
    raise UserError(f"{source}: unknown key {key[:40]!r}, {hint}")


@dataclass
class Segment:
    """Metadata and data lines of one segment.

    Parameters
    ----------
    where : str
        File name in messages.
    meta : dict, optional
        Keys of the metadata block.
    rows : list of tuple, optional
        (line number, words) of the data.
    """

    where: str
    meta: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def require(self, key: str) -> str:
        """Return the value of a required key.

        Returns
        -------
        str
            Value as in the file.

        Raises
        ------
        UserError
            If it is missing.
        """
        if key not in self.meta:
            raise UserError(f"{self.where}: a metadata block lacks the key {key}: add it")
        return self.meta[key]

    def require_one_of(self, key: str, allowed: Sequence[str]) -> str:
        """Return the value of a key, which must be one of ``allowed``.

        Returns
        -------
        str
            The value in capitals, as in ``allowed``.

        Raises
        ------
        UserError
            If it is missing or has another value.
        """
        value = self.require(key).upper()
        if value not in allowed:
            raise UserError(f"{self.where}: {key} is {value}, allowed: {', '.join(allowed)}")
        return value

    def set_once(self, key: str, value: str, source: str) -> None:
        """Set a key of the metadata.

        Raises
        ------
        UserError
            If it has been set already.
        """
        if key in self.meta:
            raise UserError(f"{source}: key {key} is given twice: remove one of them")
        self.meta[key] = value

    def times_s(self, epoch: Instant) -> FloatArray:
        """Return the times of the data lines, after removal of duplicate lines from ``rows``.

        Returns
        -------
        (n,) array
            Seconds since ``epoch``, increasing, one for each of ``rows``.

        Raises
        ------
        UserError
            If there is no line, a time cannot be read, or a time is not later than the one before.
        """
        system = self.require_one_of("TIME_SYSTEM", TIME_SYSTEMS)
        self.rows = [row for k, row in enumerate(self.rows) if k == 0 or row[1] != self.rows[k - 1][1]]
        if not self.rows:
            raise UserError(f"{self.where}: a segment has no data lines: add some")
        times = _seconds_since(epoch, self.rows, system, self.where)
        out_of_order = np.flatnonzero(np.diff(times) <= 0)
        if len(out_of_order):
            line, words = self.rows[out_of_order[0] + 1]
            raise UserError(
                f"{self.where}, line {line}: {words[0]} is not later than the line before it: "
                "sort the lines by time and remove doubles"
            )
        return times

    def usable_span_s(self, times_s: FloatArray, epoch: Instant) -> tuple[float, float]:
        """Return the span that may be interpolated, from the metadata or else from the lines.

        Returns
        -------
        first_s : float
            Start [s since ``epoch``], not before the first line.
        last_s : float
            End [s since ``epoch``], not after the last line.

        Raises
        ------
        UserError
            If the time system is missing or unknown, or a limit in the metadata is not a time.
        """
        system = self.require_one_of("TIME_SYSTEM", TIME_SYSTEMS)

        def read_limit(key: str, default: float) -> float:
            if key not in self.meta:
                return default
            return read_time(self.meta[key], system, f"{self.where}: {key}").minus(epoch)

        first, last = float(times_s[0]), float(times_s[-1])
        return max(read_limit("USEABLE_START_TIME", first), first), min(
            read_limit("USEABLE_STOP_TIME", last), last
        )

    def refuse_gap(self, times_s: FloatArray, k: int) -> None:
        """Raise if lines are missing between lines ``k - 1`` and ``k``.

        Raises
        ------
        UserError
            If they are; the message states the line and the length of the gap.
        """
        steps = np.diff(times_s[max(k - 1 - _GAP_NEIGHBOURS, 0) : k + 1 + _GAP_NEIGHBOURS])
        step = float(times_s[k] - times_s[k - 1])
        if step > _GAP_FACTOR * float(np.median(steps)):
            raise UserError(
                f"{self.where}, line {self.rows[k][0]}: {step:.0f} s are missing before it, and the "
                "flight falls among them: choose another epoch or fill the gap"
            )

    def numbers(self, count: int, lengths: tuple[int, ...] = ()) -> FloatArray:
        """Return the next ``count`` values of each data line, (n, count).

        Parameters
        ----------
        count : int
            Number of values to return of each line.
        lengths : tuple of int, optional
            Allowed numbers of values per line; by default any from ``count`` on.

        Returns
        -------
        (n, count) array
            Numbers in the file's units.

        Raises
        ------
        UserError
            If a line has too few or too many, or one is not a finite number.
        """
        table = []
        for line, words in self.rows:
            n_values = len(words) - 1
            if n_values < count or (lengths and n_values not in lengths):
                expected = " or ".join(str(n) for n in lengths or (count,))
                raise UserError(
                    f"{self.where}, line {line} has {n_values} values, {expected} finite ones are needed"
                )
            table.append([number(word, f"{self.where}, line {line}") for word in words[1 : count + 1]])
        return np.array(table)


def first_line(text: str) -> str:
    """Return the first line of a text that is neither blank nor a comment.

    Returns
    -------
    str
        Line without surrounding blanks; empty if there is none.
    """
    lines = (line.strip() for line in text.splitlines())
    return next((line for line in lines if line and not line.startswith("COMMENT")), "")


def read_segments(text: str, source: str, kind: str) -> list[Segment]:
    """Read the segments of an ephemeris (``OEM``) or attitude (``AEM``) message in key = value form.

    Returns
    -------
    list of Segment
        At least one, in the order of the file. A covariance is left out.

    Raises
    ------
    UserError
        If it is another file, has no segment, or an unknown key.
    """
    if not first_line(text).startswith(f"CCSDS_{kind}_VERS"):
        raise UserError(
            f"{source} is not a CCSDS {kind} in key = value form: no line starts CCSDS_{kind}_VERS"
        )
    segments: list[Segment] = []
    block = "HEADER"
    for line_number, raw in enumerate(text.splitlines(), start=1):
        line, location = raw.strip(), f"{source}, line {line_number}"
        if not line or line.startswith("COMMENT"):
            continue
        if line == "META_START":
            if block == "META":
                raise UserError(f"{location}: META_START stands in a metadata block: close that by META_STOP")
            segments.append(Segment(source))
            block = "META"
        elif line in {"COVARIANCE_START", "DATA_START"}:
            block = line.removesuffix("_START")
        elif line in {"META_STOP", "DATA_STOP", "COVARIANCE_STOP"}:
            block = ""
        elif block in {"HEADER", "META"}:
            key, equals, value = (part.strip() for part in line.partition("="))
            if not equals:
                raise UserError(f"{location}: {line[:60]!r} is not of the form KEY = value")
            if key == f"CCSDS_{kind}_VERS" and value not in VERSIONS:
                raise UserError(f"{location}: {key} is {value[:20]}, allowed: {', '.join(VERSIONS)}")
            known_keys = META_KEYS[kind] if segments else (*HEADER_KEYS, f"CCSDS_{kind}_VERS")
            refuse_unknown_key(key, known_keys, location)
            if segments:
                segments[-1].set_once(key, value, location)
        elif block != "COVARIANCE":
            if "=" in line:
                raise UserError(
                    f"{location}: {line[:60]!r} stands among the data: put it between META_START and META_STOP"
                )
            segments[-1].rows.append((line_number, line.split()))
    if not segments:
        raise UserError(f"{source} has no META_START block: add a segment")
    return segments


def read_time(text: str, system: str, source: str) -> Instant:
    """Read a calendar (2026-03-21T10:00:00) or day-of-year (2026-080T10:00:00) time of a time system.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    fields = _calendar(text)
    try:
        if fields is None:
            raise ValueError("it is not of the form 2026-03-21T10:00:00")
        year, month, day, hour, minute, second = fields
        # checks the fields, too
        instant = Instant.from_utc(
            f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:013.10f}Z"
        )
    except ValueError as error:
        raise UserError(f"{source}: {text[:60]} is not a time: {error}") from error
    return instant if system == "UTC" else Instant(*(float(x[0]) for x in _two_part_tt([fields], system)))


def _calendar(text: str) -> tuple[int, int, int, int, int, float] | None:
    """Return year, month, day, hour, minute and second of a time; None if the text has another form."""
    match = _TIME.fullmatch(text)
    if match is None:
        return None
    year, month, day, day_of_year, hour, minute, second = match.groups()
    if day_of_year is not None:
        try:
            date = dt.date(int(year), 1, 1) + dt.timedelta(int(day_of_year) - 1)
        except (ValueError, OverflowError):
            return None
        if date.year != int(year):
            return None
        month, day = date.month, date.day
    return int(year), int(month), int(day), int(hour), int(minute), float(second or 0)


def _two_part_tt(
    fields: Sequence[tuple[int, int, int, int, int, float]], system: str
) -> tuple[FloatArray, FloatArray]:
    """Convert clock readings to two-part Julian dates of terrestrial time, each (n,)."""
    scale = "UTC" if system == "UTC" else "TT"
    y, month, d, h, minute, s = zip(*fields, strict=True)
    jd1, jd2 = without_year_warning(erfa.dtf2d, scale, y, month, d, h, minute, np.array(s))
    if system == "UTC":
        jd1, jd2 = erfa.taitt(*without_year_warning(erfa.utctai, jd1, jd2))
    elif system == "TDB":
        jd2 = jd2 - np.array([tdb_minus_tt_s(a, b) for a, b in zip(jd1, jd2, strict=True)]) / DAY_S
    else:
        jd2 = jd2 + _TT_MINUS_SYSTEM_S[system] / DAY_S
    return jd1, jd2


def _seconds_since(
    epoch: Instant, rows: Sequence[tuple[int, list[str]]], system: str, source: str
) -> FloatArray:
    """Return the times of data lines, (n,) [s]."""
    fields = [_calendar(words[0]) for _, words in rows]
    valid = [f for f in fields if f and 1972 <= f[0] <= 2099 and f[3] < 24 and f[4] < 60 and f[5] < 61]
    try:
        if len(valid) < len(rows):
            raise erfa.ErfaError("a field is outside its range")
        jd1, jd2 = _two_part_tt(valid, system)
    except erfa.ErfaError:
        # read times one by one, so that the error message names the line
        instants = [read_time(words[0], system, f"{source}, line {line}") for line, words in rows]
        jd1, jd2 = np.array([i.tt1 for i in instants]), np.array([i.tt2 for i in instants])
    return np.asarray(((jd1 - epoch.tt1) + (jd2 - epoch.tt2)) * DAY_S)


def header(kind: str, version: str, created_utc: str) -> list[str]:
    """Return the opening lines of a message."""
    return [
        f"CCSDS_{kind}_VERS = {version}",
        f"CREATION_DATE = {stamp(created_utc)}",
        "ORIGINATOR = FLYAROUND",
        "",
    ]


def stamp(utc: str) -> str:
    """Return an ISO time without the Z, as in these messages."""
    return utc.removesuffix("Z")
