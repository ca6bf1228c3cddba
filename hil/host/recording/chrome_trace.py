"""Export of a run as a Chrome trace, for Perfetto or chrome://tracing.

The file has Trace Event Format, with complete events ("X") in microseconds. Its tracks are uplink, waiting on the
board, stages of the estimator, and downlink.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord

# Process and thread numbers of the tracks; any distinct numbers serve.
HOST, BOARD = 1, 2
UPLINK, DOWNLINK, WAITING, ESTIMATING = 1, 2, 1, 2
TRACKS = {
    (HOST, UPLINK): "frame out",
    (HOST, DOWNLINK): "pose back",
    (BOARD, WAITING): "waiting",
    (BOARD, ESTIMATING): "estimating",
}


def trace_events(rows: list[FrameRecord]) -> list[dict[str, Any]]:
    """Return the events of a ledger's rows. Frames start at their time in the flight; unknown times are omitted."""
    events: list[dict[str, Any]] = [
        {"ph": "M", "name": "process_name", "pid": pid, "args": {"name": name}}
        for pid, name in ((HOST, "host"), (BOARD, "board"))
    ]
    events += [
        {"ph": "M", "name": "thread_name", "pid": pid, "tid": tid, "args": {"name": name}}
        for (pid, tid), name in TRACKS.items()
    ]
    clock_us = 0.0
    for row in rows:
        # in lockstep, frames follow each other independently of the flight's pace
        time_us = max(clock_us, 1e6 * row.t_s)
        args = {"frame": row.frame_id, "outcome": row.outcome, "reason": row.reason}
        time_us = _span(events, HOST, UPLINK, f"frame {row.frame_id}", time_us, row.uplink_ms, args)
        time_us = _span(events, BOARD, WAITING, "waiting", time_us, row.board_wait_ms, args)
        start = time_us
        for name, ms in row.stages_ms.items():
            time_us = _span(events, BOARD, ESTIMATING, name, time_us, ms, args)
        if row.board_total_ms is not None and row.board_wait_ms is not None:
            time_us = start + 1e3 * (row.board_total_ms - row.board_wait_ms)
        time_us = _span(events, HOST, DOWNLINK, f"pose {row.frame_id}", time_us, row.downlink_ms, args)
        clock_us = time_us
    return events


def _span(
    events: list[dict[str, Any]],
    pid: int,
    tid: int,
    name: str,
    at_us: float,
    ms: float | None,
    args: dict[str, Any],
) -> float:
    if ms is None:
        return at_us
    events.append(
        {"ph": "X", "name": name, "pid": pid, "tid": tid, "ts": at_us, "dur": 1e3 * ms, "args": args}
    )
    return at_us + 1e3 * ms


def write_trace(rows: list[FrameRecord], path: Path) -> None:
    """Write a ledger's rows as a trace file."""
    text = json.dumps({"traceEvents": trace_events(rows), "displayTimeUnit": "ms"})
    write_atomic(path, text.encode())
