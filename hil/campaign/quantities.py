"""Quantities of a run for requirements: from its summary, its ledger's rows and its loop's decisions."""

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

MAX_BYTES = 1 << 28
Value: TypeAlias = "float | str | None"


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Files of a run in its folder.

    Parameters
    ----------
    steps : dict of str to list of str
        Columns of ``closed_loop.csv`` by name, empty where there is none.
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
            If a file is gone or damaged.
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
        Unit of a number, or nothing.
    meaning : str
        A few words; they name the frames, unless these are all that were sent.
    of : callable
        Returns the run's value, or None if it has none; then no requirement on it passes.
    needs : frozenset of str
        Traits of a case without which there is none: ``frames``, ``closed_loop``, ``times`` (real time, because in
        lockstep the flight's clock stands still for the board).
    words : tuple of str
        All values of a quantity of text.
    """

    unit: str
    meaning: str
    of: Callable[[RunRecord], Value]
    needs: frozenset[str] = frozenset()
    words: tuple[str, ...] = ()

    @property
    def is_text(self) -> bool:
        """True if it is a word."""
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

    return Quantity(unit=unit, meaning=meaning, of=value, needs=frozenset(needs.split()), words=words)


def _count(
    part: Callable[[LedgerSummary], int | None], of: Callable[[LedgerSummary], int]
) -> Callable[..., Value]:
    """Return a count, without a value if nothing could have been counted."""

    def value(record: RunRecord) -> Value:
        counted = part(record.summary) if of(record.summary) else None
        return None if counted is None else float(counted)

    return value


def _share(part: Callable[[LedgerSummary], int]) -> Callable[[RunRecord], Value]:
    return lambda r: part(r.summary) / r.summary.sent if r.summary.sent else None


def _over_sent(column: str, q: float) -> Callable[[RunRecord], Value]:
    """Return a percentile over the frames sent to the board; a missing time counts as infinite."""

    def value(record: RunRecord) -> Value:
        sent = [getattr(row, column) for row in record.rows if row.send_ms is not None]
        times = sorted(ms for ms in sent if ms is not None)
        rank = q / 100 * (len(sent) - 1)
        if math.ceil(rank) >= len(times):
            return None
        return float(np.interp(rank, range(len(times)), times))

    return value


def _came(s: LedgerSummary) -> int:
    """Return the number of poses received, in time or not."""
    return s.accepted + s.declined + s.link.late_poses


def _unaccounted(record: RunRecord) -> Value:
    """Return the number of frames whose row is missing, duplicate, or counted otherwise in the summary."""
    s, rows = record.summary, record.rows
    counted = s.accepted + s.declined + s.dropped_total
    twice = len(rows) - len({row.frame_id for row in rows})
    return float(abs(s.sent - counted) + abs(s.sent - len(rows)) + twice)


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
    """Return the time in the phase ``hold``."""
    times, phases = _step_numbers(record, "t_s"), record.steps.get("phase", [])
    if len(times) < 2 or len(times) != len(phases):
        return None
    return float((times[1] - times[0]) * phases.count("hold"))


_LOOP, _FRAMES, _TIMES = frozenset({"closed_loop"}), frozenset({"frames"}), frozenset({"times"})

QUANTITIES: dict[str, Quantity] = {
    "outcome": _summary(
        "closed_loop.outcome", "", "how the approach ended", "closed_loop", ("arrived", "aborted", "failed")
    ),
    "final_error_m": _summary("closed_loop.final_error_m", "m", "from the hold point", "closed_loop"),
    "final_error_deg": _summary(
        "closed_loop.final_error_deg", "deg", "pointing, or the target's estimated attitude", "closed_loop"
    ),
    "min_range_m": _summary("closed_loop.min_range_m", "m", "nearest to the target", "closed_loop"),
    "keep_out_violations": _summary(
        "closed_loop.keep_out_violations",
        "",
        "periods inside the sphere, outside the corridor",
        "closed_loop",
    ),
    "delta_v_m_s": _summary("closed_loop.delta_v_m_s", "m/s", "spent", "closed_loop"),
    "duration_s": _summary("closed_loop.duration_s", "s", "of the approach", "closed_loop"),
    "pose_age_s": Quantity(
        unit="s", meaning="oldest newest pose in the estimate", of=_largest_step("pose_age_s"), needs=_LOOP
    ),
    "position_sigma_m": Quantity(
        unit="m",
        meaning="largest 1-sigma of the estimated position",
        of=_largest_step("position_sigma_m"),
        needs=_LOOP,
    ),
    "nees": Quantity(unit="", meaning="mean of the filter's 12 states", of=_mean_nees, needs=_LOOP),
    "hold_s": Quantity(unit="s", meaning="time that the chaser held", of=_hold_s, needs=_LOOP),
    "ended": _summary(
        "ended", "", "how the run ended", "", ("completed", "board_lost", "no_board", "interrupted", "failed")
    ),
    "unaccounted": Quantity(
        unit="", meaning="frames without exactly one outcome", of=_unaccounted, needs=_FRAMES
    ),
    "sent": _summary("sent", "", "frames that were offered to a board, whatever became of them", "frames"),
    "accepted_share": Quantity(
        unit="",
        meaning="poses that the board accepted, right or wrong",
        of=_share(lambda s: s.accepted),
        needs=_FRAMES,
    ),
    "dropped_share": Quantity(
        unit="",
        meaning="frames without an answer, right or wrong",
        of=_share(lambda s: s.dropped_total),
        needs=_FRAMES,
    ),
    "dropped": Quantity(
        unit="",
        meaning="frames without an answer, right or wrong",
        of=_count(lambda s: s.dropped_total, lambda s: s.sent),
        needs=_FRAMES,
    ),
    "accepted_wrong": Quantity(
        unit="",
        meaning="of accepted poses whose truth is known, those beyond 5 deg or 5 % of the range",
        of=_count(lambda s: s.accepted_wrong, lambda s: s.accepted_known or 0),
        needs=_FRAMES,
    ),
    "median_E_T_m": _summary("median_E_T_m", "m", "error of accepted poses", "frames"),
    "median_E_R_deg": _summary("median_E_R_deg", "deg", "error of accepted poses", "frames"),
    "largest_E_T_m": Quantity(
        unit="m", meaning="error of accepted poses", of=_largest_error("E_T_m"), needs=_FRAMES
    ),
    "largest_E_R_deg": Quantity(
        unit="deg", meaning="error of accepted poses", of=_largest_error("E_R_deg"), needs=_FRAMES
    ),
    **{
        f"{column}_{name}": Quantity(
            unit="ms",
            meaning=f"{meaning}, of frames that the board was sent; without it a frame took infinitely long",
            of=_over_sent(column, q),
            needs=_TIMES,
        )
        for column, meaning, names in (
            ("e2e_ms", "frame out to pose back", "p50 p95 p99 max"),
            ("staleness_ms", "age of the picture when it was used", "p50 p95 p99 max"),
            ("board_total_ms", "time on the board", "p50 p99"),
        )
        for name, q in (("p50", 50.0), ("p95", 95.0), ("p99", 99.0), ("max", 100.0))
        if name in names.split()
    },
    **{
        name: _summary(
            name, "ms", f"{meaning}: of frames that the camera handed over, answered or not", "times"
        )
        for name, meaning in (
            *(
                (f"handover_error_ms_{q}", "the camera's latency, off by")
                for q in ("p50", "p99", "p999", "max")
            ),
            *((f"send_lag_ms_{q}", "sent later than due") for q in ("p50", "p99")),
        )
    },
    "deadline_misses": Quantity(
        unit="",
        meaning="frames that were not answered by the deadline",
        of=_count(lambda s: s.deadline_misses, lambda s: s.sent),
        needs=_TIMES,
    ),
    "late": _summary("late", "", "pictures not drawn in time, answered or not", "times"),
    "clock_offset_bound_ms": _summary(
        "link.clock_offset_bound_ms", "ms", "of the board's clock, by its answers to clock requests", "times"
    ),
    "clock_drift_ppm": _summary(
        "link.clock_drift_ppm", "ppm", "of the board's clock, by its answers to clock requests", "times"
    ),
    "packets_corrupt": _summary(
        "link.packets_corrupt", "", "damaged on the line, of the packets that came from the board", "times"
    ),
    "late_poses": Quantity(
        unit="",
        meaning="of the poses that came, those after their time, not used",
        of=_count(lambda s: s.link.late_poses, _came),
        needs=_TIMES,
    ),
}
"""Quantities by the name in a campaign file."""
