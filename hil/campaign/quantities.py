"""Quantities of a run for requirements, from its summary, its ledger's rows and its loop's decisions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import msgspec
import numpy as np

from flyaround.hil.host.closed_loop_run import read_steps
from flyaround.hil.host.frame_record import ACCEPTED
from flyaround.hil.host.ledger.frames_csv import FRAMES_CSV, read_ledger
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord

# Maximum size of an accepted summary [bytes].
MAX_BYTES = 1 << 28
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
        OSError, UserError, msgspec.DecodeError
            If a file is missing or damaged.
        """
        summary = msgspec.json.decode(read_regular(folder / SUMMARY_JSON, MAX_BYTES), type=LedgerSummary)
        rows = tuple(read_ledger(folder)) if (folder / FRAMES_CSV).exists() else ()
        return RunRecord(summary, rows, read_steps(folder))


@dataclass(frozen=True, kw_only=True)
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


def _summary(name: str, unit: str, meaning: str, needs: str = "", words: tuple[str, ...] = ()) -> Quantity:
    """Return the quantity of a key of the summary, or of a table in it (``link.late_poses``)."""

    def value(record: RunRecord) -> Value:
        item: object = record.summary
        for key in name.split("."):
            item = getattr(item, key, None)
        if isinstance(item, str):
            return item
        return float(item) if isinstance(item, int | float) and math.isfinite(item) else None

    return Quantity(unit=unit, meaning=meaning, value_of=value, needs=frozenset(needs.split()), words=words)


def _count(
    part: Callable[[LedgerSummary], int | None], total: Callable[[LedgerSummary], int]
) -> Callable[..., Value]:
    """Return a count, without a value if nothing could have been counted."""

    def value(record: RunRecord) -> Value:
        counted = part(record.summary) if total(record.summary) else None
        return None if counted is None else float(counted)

    return value


def _share(part: Callable[[LedgerSummary], int]) -> Callable[[RunRecord], Value]:
    return lambda r: part(r.summary) / r.summary.sent if r.summary.sent else None


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


def _largest_step(column: str) -> Callable[[RunRecord], Value]:
    def value(record: RunRecord) -> Value:
        numbers = _step_numbers(record, column)
        return float(numbers.max()) if len(numbers) else None

    return value


def _mean_nees(record: RunRecord) -> Value:
    numbers = _step_numbers(record, "nees")
    return float(numbers.mean()) if len(numbers) else None


def _hold_s(record: RunRecord) -> Value:
    """Return the time in the phase ``hold`` [s]."""
    times, phases = _step_numbers(record, "t_s"), record.steps.get("phase", [])
    if len(times) < 2 or len(times) != len(phases):
        return None
    return float((times[1] - times[0]) * phases.count("hold"))


_LOOP, _FRAMES, _TIMES = frozenset({"closed_loop"}), frozenset({"frames"}), frozenset({"times"})

QUANTITIES: dict[str, Quantity] = {
    "outcome": _summary(
        "closed_loop.outcome", "", "how the approach ended", "closed_loop", ("arrived", "aborted", "failed")
    ),
    "final_error_m": _summary(
        "closed_loop.final_error_m", "m", "distance from the hold point at the end", "closed_loop"
    ),
    "final_error_deg": _summary(
        "closed_loop.final_error_deg",
        "deg",
        "error of pointing, or of the estimated attitude, whichever is larger",
        "closed_loop",
    ),
    "min_range_m": _summary("closed_loop.min_range_m", "m", "least distance from the target", "closed_loop"),
    "keep_out_violations": _summary(
        "closed_loop.keep_out_violations",
        "",
        "control periods inside the keep-out sphere but outside the corridor",
        "closed_loop",
    ),
    "delta_v_m_s": _summary("closed_loop.delta_v_m_s", "m/s", "velocity change spent", "closed_loop"),
    "duration_s": _summary("closed_loop.duration_s", "s", "duration of the approach", "closed_loop"),
    "pose_age_s": Quantity(
        unit="s",
        meaning="largest age of the newest pose in the estimate",
        value_of=_largest_step("pose_age_s"),
        needs=_LOOP,
    ),
    "position_sigma_m": Quantity(
        unit="m",
        meaning="largest 1-sigma of the estimated position",
        value_of=_largest_step("position_sigma_m"),
        needs=_LOOP,
    ),
    "nees": Quantity(
        unit="",
        meaning="mean normalised estimation error squared, 12 states",
        value_of=_mean_nees,
        needs=_LOOP,
    ),
    "hold_s": Quantity(unit="s", meaning="time in phase hold", value_of=_hold_s, needs=_LOOP),
    "ended": _summary(
        "ended", "", "how the run ended", "", ("completed", "board_lost", "no_board", "interrupted", "failed")
    ),
    "unaccounted": Quantity(
        unit="", meaning="frames without exactly one outcome", value_of=_unaccounted, needs=_FRAMES
    ),
    "sent": _summary("sent", "", "frames offered to a board", "frames"),
    "accepted_share": Quantity(
        unit="",
        meaning="share of poses that the board accepted, correct or not",
        value_of=_share(lambda s: s.accepted),
        needs=_FRAMES,
    ),
    "dropped_share": Quantity(
        unit="",
        meaning="share of frames without an answer",
        value_of=_share(lambda s: s.dropped_total),
        needs=_FRAMES,
    ),
    "dropped": Quantity(
        unit="",
        meaning="frames without an answer",
        value_of=_count(lambda s: s.dropped_total, lambda s: s.sent),
        needs=_FRAMES,
    ),
    "accepted_wrong": Quantity(
        unit="",
        meaning="accepted poses with an error above 5 deg or 5 % of the range, if the truth is known",
        value_of=_count(lambda s: s.accepted_wrong, lambda s: s.accepted_known or 0),
        needs=_FRAMES,
    ),
    "median_E_T_m": _summary("median_E_T_m", "m", "median position error of accepted poses", "frames"),
    "median_E_R_deg": _summary("median_E_R_deg", "deg", "median attitude error of accepted poses", "frames"),
    "largest_E_T_m": Quantity(
        unit="m",
        meaning="largest position error of accepted poses",
        value_of=_largest_error("E_T_m"),
        needs=_FRAMES,
    ),
    "largest_E_R_deg": Quantity(
        unit="deg",
        meaning="largest attitude error of accepted poses",
        value_of=_largest_error("E_R_deg"),
        needs=_FRAMES,
    ),
    **{
        f"{column}_{name}": Quantity(
            unit="ms",
            meaning=f"{meaning}, over frames sent to the board; infinite for a frame without it",
            value_of=_percentile_over_sent(column, q),
            needs=_TIMES,
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
        name: _summary(name, "ms", f"{meaning}, over frames handed over by the camera", "times")
        for name, meaning in (
            *(
                (f"handover_error_ms_{q}", "error of the camera's latency")
                for q in ("p50", "p99", "p999", "max")
            ),
            *((f"send_lag_ms_{q}", "delay of sending") for q in ("p50", "p99")),
        )
    },
    "deadline_misses": Quantity(
        unit="",
        meaning="frames without an answer by the deadline",
        value_of=_count(lambda s: s.deadline_misses, lambda s: s.sent),
        needs=_TIMES,
    ),
    "late": _summary("late", "", "frames not rendered in time", "times"),
    "clock_offset_bound_ms": _summary(
        "link.clock_offset_bound_ms",
        "ms",
        "bound of the board's clock offset, from its answers to clock requests",
        "times",
    ),
    "clock_drift_ppm": _summary(
        "link.clock_drift_ppm",
        "ppm",
        "drift of the board's clock, from its answers to clock requests",
        "times",
    ),
    "packets_corrupt": _summary(
        "link.packets_corrupt", "", "corrupt packets received from the board", "times"
    ),
    "late_poses": Quantity(
        unit="",
        meaning="poses received too late to be used",
        value_of=_count(lambda s: s.link.late_poses, _poses_received),
        needs=_TIMES,
    ),
}
"""Quantities by the name in a campaign file."""
