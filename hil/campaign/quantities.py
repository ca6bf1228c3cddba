"""Quantities of a run for requirements, from its summary, its ledger's rows and its loop's decisions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from flyaround.hil.host.closed_loop_run import read_steps
from flyaround.hil.host.frame_record import ACCEPTED
from flyaround.hil.host.ledger.frames_csv import FRAMES_CSV, read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary, read_summary

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord

Value: TypeAlias = "float | str | None"


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Files of a run's folder.

    Parameters
    ----------
    summary : LedgerSummary
        Summary of the ledger.
    rows : tuple of FrameRecord
        Rows of the ledger.
    steps : dict of str to list of str
        Columns of ``closed_loop.csv`` by name; empty without a closed loop.
    """

    summary: LedgerSummary
    rows: tuple[FrameRecord, ...]
    steps: dict[str, list[str]]

    @staticmethod
    def read(folder: Path) -> RunRecord:
        """Read the record of a run's folder.

        Raises
        ------
        UserError
            If a file is missing or damaged.
        """
        rows = tuple(read_ledger(folder)) if (folder / FRAMES_CSV).exists() else ()
        return RunRecord(read_summary(folder), rows, read_steps(folder))


@dataclass(frozen=True)
class Quantity:
    """Number or word derived from a run.

    Parameters
    ----------
    unit : str
        Unit of a number; empty for a count or a word.
    meaning : str
        Description in a few words; it names the frames, unless it covers all that were sent.
    value_of : callable
        Returns the run's value, or None without one, in which case every requirement on it fails.
    needs : frozenset of str
        Traits of a case that the quantity requires: ``frames``, ``closed_loop``, ``times`` (real time, because in
        lockstep the flight's clock waits for the board).
    words : tuple of str
        All possible values of a text quantity.
    """

    unit: str
    meaning: str
    value_of: Callable[[RunRecord], Value]
    needs: frozenset[str] = frozenset()
    words: tuple[str, ...] = ()

    @property
    def is_text(self) -> bool:
        """True if its values are words."""
        return bool(self.words)

    @property
    def needs_in_words(self) -> str:
        """Traits that a case needs, in words."""
        phrases = {
            "frames": "frames that are sent to a board",
            "closed_loop": "closed_loop = true",
            "times": 'mode = "realtime" and a board',
        }
        return " and ".join(phrases[need] for need in sorted(self.needs))


def _summary(name: str) -> Callable[[RunRecord], Value]:
    """Return the value of a key of the summary, or of a table in it (``link.late_poses``)."""

    def value(record: RunRecord) -> Value:
        item: object = record.summary
        for key in name.split("."):
            item = getattr(item, key, None)
        if isinstance(item, str):
            return item
        return float(item) if isinstance(item, int | float) and math.isfinite(item) else None

    return value


def _if_any(
    total: Callable[[LedgerSummary], int], part: Callable[[LedgerSummary], float | None]
) -> Callable[[RunRecord], Value]:
    """Return a count or share, without a value if nothing could have been counted."""

    def value(record: RunRecord) -> Value:
        counted = part(record.summary) if total(record.summary) else None
        return None if counted is None else float(counted)

    return value


def _if_sent(part: Callable[[LedgerSummary], float | None]) -> Callable[[RunRecord], Value]:
    return _if_any(lambda s: s.sent, part)


def _percentile_over_sent(column: str, q: float) -> Callable[[RunRecord], Value]:
    """Return a percentile over the frames sent to the board; a missing time counts as infinite."""

    def value(record: RunRecord) -> Value:
        sent_times = [getattr(row, column) for row in record.rows if row.send_ms is not None]
        times = sorted(ms for ms in sent_times if ms is not None)
        rank = q / 100 * (len(sent_times) - 1)
        if math.ceil(rank) >= len(times):
            return None
        return float(np.interp(rank, range(len(times)), times))

    return value


def _poses_received(s: LedgerSummary) -> int:
    """Return the number of poses received, in time or not."""
    return s.accepted + s.declined + s.link.late_poses


def _unaccounted(record: RunRecord) -> Value:
    """Return the number of frames whose row is missing, duplicate, or counted differently in the summary."""
    s, rows = record.summary, record.rows
    counted = s.accepted + s.declined + s.dropped_total
    n_duplicates = len(rows) - len({row.frame_id for row in rows})
    return float(abs(s.sent - counted) + abs(s.sent - len(rows)) + n_duplicates)


def _largest_error(name: str) -> Callable[[RunRecord], Value]:
    def value(record: RunRecord) -> Value:
        errors = [getattr(row, name) for row in record.rows if row.outcome == ACCEPTED]
        return max((error for error in errors if error is not None), default=None)

    return value


def _step_numbers(record: RunRecord, column: str) -> np.ndarray:
    return np.array([float(cell) for cell in record.steps.get(column, []) if cell])


def _of_steps(reduce: Callable[[np.ndarray], float], column: str) -> Callable[[RunRecord], Value]:
    """Return a statistic of a column of the loop's steps."""

    def value(record: RunRecord) -> Value:
        numbers = _step_numbers(record, column)
        return float(reduce(numbers)) if len(numbers) else None

    return value


def _hold_s(record: RunRecord) -> Value:
    """Return the time in the phase ``hold`` [s]."""
    times, phases = _step_numbers(record, "t_s"), record.steps.get("phase", [])
    if len(times) < 2 or len(times) != len(phases):
        return None
    return float((times[1] - times[0]) * phases.count("hold"))


_BY_NEED: dict[str, dict[str, Quantity]] = {
    "closed_loop": {
        "outcome": Quantity(
            "",
            "how the approach ended",
            _summary("closed_loop.outcome"),
            words=("arrived", "aborted", "failed"),
        ),
        **{
            name: Quantity(unit, meaning, _summary(f"closed_loop.{name}"))
            for name, unit, meaning in (
                ("final_error_m", "m", "distance from the hold point at the end"),
                (
                    "final_error_deg",
                    "deg",
                    "error of pointing, or of the estimated attitude, whichever is larger",
                ),
                ("min_range_m", "m", "least distance from the target"),
                (
                    "keep_out_violations",
                    "",
                    "control periods inside the keep-out sphere but outside the corridor",
                ),
                ("delta_v_m_s", "m/s", "velocity change spent"),
                ("duration_s", "s", "duration of the approach"),
            )
        },
        "pose_age_s": Quantity(
            "s", "largest age of the newest pose in the estimate", _of_steps(np.max, "pose_age_s")
        ),
        "position_sigma_m": Quantity(
            "m", "largest 1-sigma of the estimated position", _of_steps(np.max, "position_sigma_m")
        ),
        "nees": Quantity(
            "", "mean normalised estimation error squared, 12 states", _of_steps(np.mean, "nees")
        ),
        "hold_s": Quantity("s", "time in phase hold", _hold_s),
    },
    "": {
        "ended": Quantity(
            "",
            "how the run ended",
            _summary("ended"),
            words=("completed", "board_lost", "no_board", "interrupted", "failed"),
        ),
    },
    "frames": {
        "unaccounted": Quantity("", "frames without exactly one outcome", _unaccounted),
        "sent": Quantity("", "frames offered to a board", _summary("sent")),
        "accepted_share": Quantity(
            "",
            "share of poses that the board accepted, correct or not",
            _if_sent(lambda s: s.accepted / s.sent),
        ),
        "dropped_share": Quantity(
            "", "share of frames without an answer", _if_sent(lambda s: s.dropped_total / s.sent)
        ),
        "dropped": Quantity("", "frames without an answer", _if_sent(lambda s: s.dropped_total)),
        "accepted_wrong": Quantity(
            "",
            "accepted poses with an error above 5 deg or 5 % of the range, if the truth is known",
            _if_any(lambda s: s.accepted_known or 0, lambda s: s.accepted_wrong),
        ),
        **{
            f"{statistic}_{error}": Quantity(unit, f"{statistic} {meaning} of accepted poses", value(error))
            for statistic, value in (
                ("median", lambda e: _summary(f"median_{e}")),
                ("largest", _largest_error),
            )
            for error, unit, meaning in (
                ("E_T_m", "m", "position error"),
                ("E_R_deg", "deg", "attitude error"),
            )
        },
    },
    "times": {
        **{
            f"{column}_{name}": Quantity(
                "ms",
                f"{meaning}, over frames sent to the board; infinite for a frame without it",
                _percentile_over_sent(column, q),
            )
            for column, meaning, names in (
                ("e2e_ms", "time from sending a frame to receiving its pose", "p50 p95 p99 max"),
                ("staleness_ms", "age of the image when its pose was used", "p50 p95 p99 max"),
                ("board_total_ms", "time on the board", "p50 p99"),
            )
            for name, q in (("p50", 50.0), ("p95", 95.0), ("p99", 99.0), ("max", 100.0))
            if name in names.split()
        },
        **{
            f"{name}_{q}": Quantity(
                "ms", f"{meaning}, over frames handed over by the camera", _summary(f"{name}_{q}")
            )
            for name, meaning, endings in (
                ("handover_error_ms", "error of the camera's latency", "p50 p99 p999 max"),
                ("send_lag_ms", "delay of sending", "p50 p99"),
            )
            for q in endings.split()
        },
        "deadline_misses": Quantity(
            "", "frames without an answer by the deadline", _if_sent(lambda s: s.deadline_misses)
        ),
        "late": Quantity("", "frames not rendered in time", _summary("late")),
        **{
            name: Quantity(unit, meaning, _summary(f"link.{name}"))
            for name, unit, meaning in (
                (
                    "clock_offset_bound_ms",
                    "ms",
                    "bound of the board's clock offset, from its answers to clock requests",
                ),
                ("clock_drift_ppm", "ppm", "drift of the board's clock, from its answers to clock requests"),
                ("packets_corrupt", "", "corrupt packets received from the board"),
            )
        },
        "late_poses": Quantity(
            "", "poses received too late to be used", _if_any(_poses_received, lambda s: s.link.late_poses)
        ),
    },
}

QUANTITIES: dict[str, Quantity] = {
    name: replace(quantity, needs=frozenset(need.split()))
    for need, group in _BY_NEED.items()
    for name, quantity in group.items()
}
