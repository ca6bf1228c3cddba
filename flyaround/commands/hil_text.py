"""What hil host says to a person: where to connect a board, and what a run came to."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from hil.evaluate.frame_record import COARSE_DEG, COARSE_SHARE
from hil.link.transports.url import parse_url

if TYPE_CHECKING:
    from hil.host.ledger.summary import LedgerSummary

ANY_ADDRESS = ("0.0.0.0", "::")  # noqa: S104 - listened on at the user's wish


def listening_text(url: str, truth_url: str | None, target: str) -> str:
    """Where a host listens, and what to type on the board."""
    there = board_url(url)
    lines = [
        f"listening on {url}; on the board type",
        f"  flyaround hil board {there} --target {target}",
        f"or, with the file that flyaround hil bundle board.pyz --target {target} writes,",
        f"  python3 board.pyz {there} --model {target}",
    ]
    if url.startswith("serial"):
        lines.append("with the board's own name of the line in place of this machine's")
    if truth_url is not None:
        lines.append(f"ground truth, for loggers alone: {truth_url}")
    return "\n".join(lines)


def board_url(url: str) -> str:
    """What a board connects to: this machine by its name where it listens on all its addresses."""
    scheme, host, port = parse_url(url)
    if scheme == "tcp" and host in ANY_ADDRESS:
        return f"tcp://{socket.gethostname()}:{port}"
    return url


def summary_text(s: LedgerSummary, log: Path | None) -> Text:
    """The summary in a few lines; red is what should not be."""
    causes = ", ".join(f"{n} {cause}" for cause, n in s.dropped.items())
    dropped = f"{s.dropped_total} dropped" + (f" ({causes})" if causes else "")
    lines: list[str | Text] = [
        f"{s.sent} frames sent: {s.accepted} accepted, {s.declined} declined, {dropped}"
    ]
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
        lines.append(f"later than the deadline of {s.deadline_ms:.0f} ms: {s.deadline_misses}")
    if log is not None:
        lines.append(f"ledger: {log}; a page with plots: flyaround hil report {log}")
    return Text("\n").join(Text(line) if isinstance(line, str) else line for line in lines)
