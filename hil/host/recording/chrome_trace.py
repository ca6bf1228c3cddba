"""Run as a Chrome trace, for Perfetto or chrome://tracing.

Trace Event Format, complete events ("X"), microseconds. Tracks: rendering, uplink, board, stages, downlink.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord

HOST, BOARD = 1, 2
LINE_OUT, LINE_BACK, WAITING, ESTIMATING = 1, 2, 1, 2
TRACKS = {
    (HOST, LINE_OUT): "frame out",
    (HOST, LINE_BACK): "pose back",
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
        at = max(clock_us, 1e6 * row.t_s)
        about = {"frame": row.frame_id, "outcome": row.outcome, "reason": row.reason}
        at = _span(events, HOST, LINE_OUT, f"frame {row.frame_id}", at, row.uplink_ms, about)
        at = _span(events, BOARD, WAITING, "waiting", at, row.board_wait_ms, about)
        start = at
        for name, ms in row.stages_ms.items():
            at = _span(events, BOARD, ESTIMATING, name, at, ms, about)
        if row.board_total_ms is not None and row.board_wait_ms is not None:
            at = start + 1e3 * (row.board_total_ms - row.board_wait_ms)
        at = _span(events, HOST, LINE_BACK, f"pose {row.frame_id}", at, row.downlink_ms, about)
        clock_us = at
    return events


def _span(
    events: list[dict[str, Any]],
    pid: int,
    tid: int,
    name: str,
    at_us: float,
    ms: float | None,
    about: dict[str, Any],
) -> float:
    if ms is None:
        return at_us
    events.append(
        {"ph": "X", "name": name, "pid": pid, "tid": tid, "ts": at_us, "dur": 1e3 * ms, "args": about}
    )
    return at_us + 1e3 * ms


def write_trace(rows: list[FrameRecord], path: Path) -> None:
    """Write a ledger's rows as a trace file."""
    text = json.dumps({"traceEvents": trace_events(rows), "displayTimeUnit": "ms"})
    write_atomic(path, text.encode())
