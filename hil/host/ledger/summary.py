"""Summary of a ledger, written as ``summary.json``: counts of outcomes, latency percentiles, pose errors."""

from __future__ import annotations

import os
import platform
from array import array
from collections import Counter
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from flyaround.hil.board.method_names import name_in_file
from flyaround.hil.host.frame_record import ACCEPTED, DECLINED, DROPPED
from flyaround.hil.host.link_process.ipc import Board, Count, LinkTotals
from flyaround.hil.link.packets.packet import PROTOCOL_VERSION
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.runtime.arrays import FloatArray

SUMMARY_JSON = "summary.json"

# Maximum size of an accepted summary.json [bytes], thousands of times the usual size.
MAX_BYTES = 1 << 24


class StageTimes(msgspec.Struct, frozen=True, kw_only=True):
    """Times of one stage of the board's estimator over the answered frames."""

    name: str
    p50_ms: float
    p99_ms: float
    max_ms: float


class Machine(msgspec.Struct, frozen=True, kw_only=True):
    """Description of the machine that the host ran on."""

    system: str
    processor: str
    cpus: int
    python: str


class ClosedLoopFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a closed loop; ``final_error_m`` is the true distance from the end of the path.

    ``final_error_deg`` is the larger one of the camera's pointing error and the error of the estimated target attitude.
    ``keep_out_violations`` counts control periods that began inside the keep-out sphere but outside the corridor.
    """

    pose: Literal["board", "truth", "noisy"]
    outcome: Literal["arrived", "aborted", "failed"]
    reason: str = ""
    final_error_m: float
    final_error_deg: float
    min_range_m: float
    keep_out_violations: Count
    delta_v_m_s: float
    seed: int
    duration_s: float


class LedgerSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Summary of a run; ``sent = accepted + declined + dropped_total`` always holds.

    Percentiles are over answered frames, medians of errors over accepted ones. A deadline miss is a frame without an
    answer within ``deadline_ms``: late, dropped, or not sent to the board. ``accepted_known`` counts accepted poses
    with a known truth, ``accepted_wrong`` those of them beyond 5 deg or 5 % of the range. ``time_faults`` counts
    answers with impossible times of the board, which are ignored. The values ``killed`` and ``unknown`` occur only in
    reports of runs without a summary.
    """

    schema: Literal["flyaround.ledger_summary"] = "flyaround.ledger_summary"
    version: Literal[1] = 1
    protocol_version: int = PROTOCOL_VERSION
    started_utc: str
    ended: Literal["completed", "board_lost", "no_board", "interrupted", "failed", "killed"]
    board_gone: str = ""
    mode: Literal["lockstep", "realtime"]
    truth: Literal["off", "separate", "inline", "unknown"]
    url: str
    timeout_s: float
    sent: Count
    accepted: Count
    declined: Count
    dropped: dict[str, Count]
    dropped_total: Count
    accepted_known: Count | None = None
    accepted_wrong: Count | None = None
    time_faults: Count = 0
    e2e_ms_p50: float | None = None
    e2e_ms_p90: float | None = None
    e2e_ms_p99: float | None = None
    e2e_ms_max: float | None = None
    send_lag_ms_p50: float | None = None
    send_lag_ms_p99: float | None = None
    board_total_ms_p50: float | None = None
    board_total_ms_p99: float | None = None
    render_ms_p50: float | None = None
    stages: list[StageTimes] = []
    deadline_ms: float | None = None
    deadline_misses: Count | None = None
    latency_ms: float | None = None
    late: Count | None = None
    handover_error_ms_p50: float | None = None
    handover_error_ms_p99: float | None = None
    handover_error_ms_p999: float | None = None
    handover_error_ms_max: float | None = None
    staleness_ms_p50: float | None = None
    staleness_ms_p95: float | None = None
    staleness_ms_p99: float | None = None
    staleness_ms_max: float | None = None
    e2e_ms_p95: float | None = None
    median_E_T_m: float | None = None
    median_E_R_deg: float | None = None
    board: Board | None = None
    link: LinkTotals = LinkTotals()
    closed_loop: ClosedLoopFigures | None = None
    machine: Machine


_PERCENTILES: dict[str, dict[str, float]] = {
    "e2e_ms": {"p50": 50, "p90": 90, "p95": 95, "p99": 99, "max": 100},
    "send_lag_ms": {"p50": 50, "p99": 99},
    "board_total_ms": {"p50": 50, "p99": 99},
    "render_ms": {"p50": 50},
    "handover_error_ms": {"p50": 50, "p99": 99, "p999": 99.9, "max": 100},
    "staleness_ms": {"p50": 50, "p95": 95, "p99": 99, "max": 100},
}
"""Percentiles of the summary, by field of the records and suffix of the summary's field."""


def this_machine() -> Machine:
    """Return the description of this machine."""
    return Machine(
        system=f"{platform.system()} {platform.release()} {platform.machine()}",
        processor=_processor(),
        cpus=os.cpu_count() or 1,
        python=platform.python_version(),
    )


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:  # noqa: PTH123 - not a project file
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def percentile(values: Sequence[float] | FloatArray, q: float) -> float | None:
    """Return percentile ``q`` by linear interpolation; None without values."""
    return float(np.percentile(np.asarray(values), q)) if len(values) else None


def read_summary(folder: Path) -> LedgerSummary:
    """Read the summary of a ledger's folder.

    Returns
    -------
    LedgerSummary
        Summary in which the estimator has its present name, if it was renamed.

    Raises
    ------
    UserError
        If it cannot be read, or was not written by this version.
    """
    path = folder / SUMMARY_JSON
    try:
        summary = msgspec.json.decode(read_regular(path, MAX_BYTES), type=LedgerSummary)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): make it readable") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{path} is not a ledger summary of this version: {error}") from error
    if summary.board is None:
        return summary
    board = msgspec.structs.replace(summary.board, method=name_in_file(summary.board.method, path))
    return msgspec.structs.replace(summary, board=board)


class LedgerTally:
    """Accumulator of the columns that a summary needs, about 80 bytes per row, so that runs of days fit in memory."""

    def __init__(self, rows: Iterable[FrameRecord] = ()) -> None:
        self.outcomes: Counter[str] = Counter()
        self.columns: dict[str, array[float]] = {name: array("d") for name in ("t_s", *_PERCENTILES)}
        self.accepted_columns: dict[str, array[float]] = {"E_T_m": array("d"), "E_R_deg": array("d")}
        self.stages_ms: dict[str, array[float]] = {}
        self.accepted_known = self.accepted_wrong = self.late = self.late_known = self.time_faults = 0
        for row in rows:
            self.add(row)

    def __len__(self) -> int:
        return self.outcomes.total()

    def add(self, row: FrameRecord) -> None:
        """Add one row."""
        self.outcomes[row.outcome] += 1
        for name, values in self.columns.items():
            value = getattr(row, name)
            if value is not None:
                values.append(value)
        for name, ms in row.stages_ms.items():
            self.stages_ms.setdefault(name, array("d")).append(ms)
        self.time_faults += bool(row.time_fault)
        self.late += row.late is True
        self.late_known += row.late is not None
        if row.outcome == ACCEPTED:
            self.accepted_known += row.wrong is not None
            self.accepted_wrong += row.wrong is True
            for name, values in self.accepted_columns.items():
                value = getattr(row, name)
                if value is not None:
                    values.append(value)

    def interval_ms(self) -> float | None:
        """Return the median interval between frames [ms]; None for fewer than two."""
        times = np.sort(self.columns["t_s"])
        return 1e3 * float(np.median(np.diff(times))) if len(times) > 1 else None


def stage_times(stages_ms: Mapping[str, Sequence[float]]) -> list[StageTimes]:
    """Return the distribution of each board stage, in order of first appearance."""
    return [
        StageTimes(
            name=name,
            p50_ms=float(np.percentile(ms, 50)),
            p99_ms=float(np.percentile(ms, 99)),
            max_ms=max(ms),
        )
        for name, ms in stages_ms.items()
    ]


def summarise(rows: Iterable[FrameRecord] | LedgerTally, **run: Any) -> LedgerSummary:  # noqa: ANN401 - its fields
    """Return the summary of a run's rows.

    Parameters
    ----------
    rows : iterable of FrameRecord or LedgerTally
        Rows of the ledger, or their tally.
    run : object
        Fields of ``LedgerSummary`` that do not follow from rows: started_utc, ended, mode, truth, url, ...

    Raises
    ------
    AssertionError
        If the counts are inconsistent, so that a frame is missing.
    """
    tally = rows if isinstance(rows, LedgerTally) else LedgerTally(rows)
    outcomes, columns = tally.outcomes, tally.columns
    dropped = {
        name.removeprefix(DROPPED): n for name, n in sorted(outcomes.items()) if name.startswith(DROPPED)
    }
    dropped_total = sum(dropped.values())
    if len(tally) != outcomes[ACCEPTED] + outcomes[DECLINED] + dropped_total:
        raise AssertionError(f"inconsistent ledger: {dict(outcomes)} of {len(tally)} frames")
    deadline_ms = run.get("deadline_ms")
    answered = columns["e2e_ms"]
    percentiles: dict[str, Any] = {
        f"{name}_{ending}": percentile(
            np.abs(columns[name]) if name == "handover_error_ms" else columns[name], q
        )
        for name, endings in _PERCENTILES.items()
        for ending, q in endings.items()
    }
    return LedgerSummary(
        sent=len(tally),
        accepted=outcomes[ACCEPTED],
        declined=outcomes[DECLINED],
        dropped=dropped,
        dropped_total=dropped_total,
        accepted_known=tally.accepted_known,
        accepted_wrong=tally.accepted_wrong,
        time_faults=tally.time_faults,
        late=tally.late if tally.late_known else None,
        **percentiles,
        stages=stage_times(tally.stages_ms),
        deadline_misses=None
        if deadline_ms is None
        else len(tally) - sum(ms <= deadline_ms for ms in answered),
        median_E_T_m=percentile(tally.accepted_columns["E_T_m"], 50),
        median_E_R_deg=percentile(tally.accepted_columns["E_R_deg"], 50),
        machine=this_machine(),
        **run,
    )
