"""Messages of ``hil host``: its address, and the outcome of its run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE
from flyaround.hil.host.board_command import board_command, board_url

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.ledger.summary import ClosedLoopFigures, LedgerSummary


def listening_text(url: str, truth_url: str | None, target: str, *, keyed: bool = False) -> str:
    """Return the address of a host, and the command to type on the board."""
    address, key = board_url(url), " --key FILE" if keyed else ""
    lines = [
        f"listening on {url}; on the board type",
        f"  {board_command(url, target, keyed=keyed)}",
        f"or, with the file from flyaround hil bundle board.pyz --target {target},",
        f"  python3 board.pyz {address} --model {target}{key}",
    ]
    if url.startswith("serial"):
        lines.append("(use the board's device name of the serial line)")
    if truth_url is not None:
        lines.append(f"ground truth for loggers: {truth_url}")
    return "\n".join(lines)


def _closed_loop_text(c: ClosedLoopFigures) -> Text:
    """Return the outcome of a closed loop with its reason; red if the chaser did not arrive."""
    reason = f": {c.reason}" if c.reason else ""
    figures = (
        f" after {c.duration_s:.0f} s, {c.final_error_m:.3f} m and {c.final_error_deg:.2f} deg from the hold point;"
        f" least range {c.min_range_m:.2f} m, {c.keep_out_violations} periods inside the keep-out sphere,"
        f" {c.delta_v_m_s:.3f} m/s spent"
    )
    return Text.assemble((c.outcome + reason, "" if c.outcome == "arrived" else "red"), figures)


def summary_text(s: LedgerSummary, log: Path | None) -> Text:
    """Return the summary in a few lines, failures in red."""
    causes = ", ".join(f"{n} {cause}" for cause, n in s.dropped.items())
    dropped = f"{s.dropped_total} dropped" + (f" ({causes})" if causes else "")
    lines: list[str | Text] = []
    if s.closed_loop is not None:
        lines.append(_closed_loop_text(s.closed_loop))
    if s.sent or s.closed_loop is None:
        lines.append(f"{s.sent} frames sent: {s.accepted} accepted, {s.declined} declined, {dropped}")
    if s.accepted_known:
        wrong = f"{s.accepted_wrong} of {s.accepted_known} accepted poses are wrong"
        limits = f" (beyond {COARSE_DEG:g} deg or {COARSE_SHARE:.0%} of the range)"
        lines.append(Text.assemble((wrong, "red" if s.accepted_wrong else ""), limits))
    if s.median_E_T_m is not None and s.median_E_R_deg is not None:
        lines.append(f"median error of accepted poses: {s.median_E_T_m:.3g} m, {s.median_E_R_deg:.3g} deg")
    if s.e2e_ms_p50 is not None:
        lines.append(
            f"latency: p50 {s.e2e_ms_p50:.1f} ms, p99 {s.e2e_ms_p99:.1f} ms, largest {s.e2e_ms_max:.1f} ms;"
            f" on the board p50 {s.board_total_ms_p50:.1f} ms"
        )
    if s.deadline_misses is not None:
        lines.append(f"not answered within the deadline of {s.deadline_ms:.0f} ms: {s.deadline_misses}")
    if s.handover_error_ms_p99 is not None:
        late = f"; {s.late} frame(s) were not rendered in time" if s.late else ""
        lines.append(
            f"handed over {s.latency_ms:g} ms after exposure, error p99 {s.handover_error_ms_p99:.3g} ms, at most"
            f" {s.handover_error_ms_max:.3g} ms{late}"
        )
    if log is not None:
        lines.append(f"ledger: {log}; a page with plots: flyaround hil report {log}")
    return Text("\n").join(Text(line) if isinstance(line, str) else line for line in lines)
