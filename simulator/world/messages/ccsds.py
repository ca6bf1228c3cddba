"""Reading and writing what CCSDS navigation messages share: key = value lines, blocks, times, frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import erfa
import numpy as np

from simulator.errors import UserError
from simulator.world.constants import DAY_S
from simulator.world.time.instant import Instant, tdb_minus_tt_s

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray

_TT_AHEAD_OF = {"TAI": 32.184, "TT": 0.0, "GPS": 51.184}
TIME_SYSTEMS = ("UTC", *_TT_AHEAD_OF, "TDB")
_GAP = 5.0
"""A spacing this many times the median is a gap, over which nothing is interpolated."""


@dataclass
class Segment:
    """Metadata and data lines of one segment.

    Parameters
    ----------
    where : file, for messages. meta : keys of the metadata block. rows : (line number, words) of the data.
    """

    where: str
    meta: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def require(self, key: str) -> str:
        """A key that must be there.

        Raises
        ------
        UserError
            If it is not.
        """
        if key not in self.meta:
            raise UserError(f"{self.where}: a metadata block lacks the key {key}: add it")
        return self.meta[key]

    def require_one_of(self, key: str, allowed: Sequence[str]) -> str:
        """A key whose value is one of ``allowed``.

        Raises
        ------
        UserError
            If it is missing or another.
        """
        value = self.require(key).upper()
        if value not in allowed:
            raise UserError(f"{self.where}: {key} is {value}, allowed: {', '.join(allowed)}")
        return value

    def instants(self) -> list[Instant]:
        """The first word of each data line as a time; the lines must be in order.

        Raises
        ------
        UserError
            If there is no line, a time cannot be read, or a time is not later than the one before.
        """
        system = self.require_one_of("TIME_SYSTEM", TIME_SYSTEMS)
        if not self.rows:
            raise UserError(f"{self.where}: a segment has no data lines: add some")
        times: list[Instant] = []
        for number, words in self.rows:
            times.append(read_time(words[0], system, f"{self.where}, line {number}"))
            if len(times) > 1 and times[-1].minus(times[-2]) <= 0:
                raise UserError(
                    f"{self.where}, line {number}: {words[0]} is not later than the line before it: "
                    "sort the lines by time and remove doubles"
                )
        return times

    def usable_span(self, instants: Sequence[Instant]) -> tuple[Instant, Instant]:
        """First and last moment that may be interpolated: what the metadata say, or else all."""
        system = self.require_one_of("TIME_SYSTEM", TIME_SYSTEMS)

        def limit(key: str, otherwise: Instant) -> Instant:
            return (
                read_time(self.meta[key], system, f"{self.where}: {key}") if key in self.meta else otherwise
            )

        return limit("USEABLE_START_TIME", instants[0]), limit("USEABLE_STOP_TIME", instants[-1])

    def refuse_gap(self, times_s: FloatArray, k: int) -> None:
        """Refuse to interpolate between lines ``k - 1`` and ``k`` when lines are missing there.

        Raises
        ------
        UserError
            With the line and the length of the gap.
        """
        steps = np.diff(times_s)
        if steps[k - 1] > _GAP * float(np.median(steps)):
            raise UserError(
                f"{self.where}, line {self.rows[k][0]}: {steps[k - 1]:.0f} s are missing before it, and the "
                "flight falls among them: choose another epoch or fill the gap"
            )

    def numbers(self, count: int) -> FloatArray:
        """The next ``count`` words of each data line, (n, count).

        Raises
        ------
        UserError
            If a line has too few, or one is no finite number.
        """
        table = []
        for number, words in self.rows:
            try:
                values = [float(word) for word in words[1 : count + 1]]
            except ValueError as error:
                raise UserError(f"{self.where}, line {number}: a value is not a number") from error
            if len(values) < count or not np.all(np.isfinite(values)):
                raise UserError(
                    f"{self.where}, line {number} has {len(values)} values, {count} finite ones are needed"
                )
            table.append(values)
        return np.array(table)


def read_segments(text: str, where: str, kind: str) -> list[Segment]:
    """Segments of an ephemeris (``OEM``) or attitude (``AEM``) message in key = value form.

    Raises
    ------
    UserError
        If it is another file, or has no segment.
    """
    lines = text.splitlines()
    if not any(line.strip().startswith(f"CCSDS_{kind}_VERS") for line in lines):
        raise UserError(
            f"{where} is not a CCSDS {kind} in key = value form: no line starts CCSDS_{kind}_VERS"
        )
    segments: list[Segment] = []
    block = ""
    for number, raw in enumerate(lines, start=1):
        line = raw.strip()
        if not line or line.startswith("COMMENT"):
            continue
        if line == "META_START":
            segments.append(Segment(where))
            block = "META"
        elif line in {"COVARIANCE_START", "DATA_START"}:
            block = line.removesuffix("_START")
        elif line in {"META_STOP", "DATA_STOP", "COVARIANCE_STOP"}:
            block = ""
        elif block == "META":
            key, equals, value = line.partition("=")
            if not equals:
                raise UserError(f"{where}, line {number}: {line!r} is not of the form KEY = value")
            segments[-1].meta[key.strip()] = value.strip()
        elif block != "COVARIANCE" and segments and "=" not in line:
            segments[-1].rows.append((number, line.split()))
    if not segments:
        raise UserError(f"{where} has no META_START block: add a segment")
    return segments


def read_time(text: str, system: str, where: str) -> Instant:
    """A calendar (2026-03-21T10:00:00) or day-of-year (2026-080T10:00:00) time of a time system.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    plain = text.removesuffix("Z")
    date, _, clock = plain.partition("T")
    if date.count("-") == 1:
        year, _, day = date.partition("-")
        if year.isdigit() and day.isdigit():
            y, m, d, _ = erfa.jd2cal(
                *(a + b for a, b in zip(erfa.cal2jd(int(year), 1, 1), (0, int(day) - 1), strict=True))
            )
            date = f"{int(y):04d}-{int(m):02d}-{int(d):02d}"
    clock += "" if clock.count(":") > 1 else ":00"
    try:
        instant = Instant.from_utc(f"{date}T{clock}Z")
    except ValueError as error:
        raise UserError(f"{where}: {text} is not a time: {error}") from error
    if system == "UTC":
        return instant
    # the clock reading was taken for UTC: as a reading of TT it lies this much earlier
    utc1, utc2 = instant.utc
    if system == "TDB":
        return Instant(utc1, utc2 - tdb_minus_tt_s(utc1, utc2) / DAY_S)
    return Instant(utc1, utc2 + _TT_AHEAD_OF[system] / DAY_S)


def header(kind: str, version: str, created_utc: str) -> list[str]:
    """The opening lines of a message."""
    return [
        f"CCSDS_{kind}_VERS = {version}",
        f"CREATION_DATE = {stamp(created_utc)}",
        "ORIGINATOR = FLYAROUND",
        "",
    ]


def stamp(utc: str) -> str:
    """An ISO time as these messages write it: without the Z."""
    return utc.removesuffix("Z")
