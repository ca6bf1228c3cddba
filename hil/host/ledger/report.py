"""A page people look at, made from any ledger folder: report.html and its plots."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

from hil.host.ledger.frames_csv import FRAMES_CSV, read_ledger
from hil.host.ledger.plots import draw_plots
from hil.host.ledger.summary import RUN_JSON, SUMMARY_JSON, LedgerSummary, RunTerms, summarise
from hil.host.recording.chrome_trace import write_trace
from simulator.errors import UserError
from simulator.runtime.files import write_atomic
from simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.host.ledger.frames_csv import LedgerRow

T = TypeVar("T")

REPORT_HTML = "report.html"
TRACE_JSON = "trace.json"
# of run.json and of summary.json: thousands of times what they take
MOST_BYTES = 1 << 24
PLOT_FOLDER = "report"

CAPTIONS = {
    "latency": "From the first byte of the frame to the pose back, on the link process's monotonic clock.",
    "timeline": "Every frame in order; a red line is a frame without an answer, a red dot an accepted pose that is"
    " wrong.",
    "jitter": "Change from one answer to the next; in real time also how late frames left.",
    "outcomes": "Each frame that was offered to the link has exactly one outcome.",
    "stages": "Medians do not add up to the median of the whole; link times rest on the clock offset.",
    "errors": "Against the truth as the host knows it; an accepted pose beyond 5 deg or 5 % of the range is wrong.",
}

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;background:#f5f7fa;margin:0}
main{max-width:1080px;margin:0 auto;padding:32px 24px 64px}
h1{font-size:26px;margin:0 0 2px}p.dim,figcaption{color:#7b8794;font-size:13px;margin:2px 0 0}
.tiles{display:flex;flex-wrap:wrap;gap:12px;margin:22px 0}
.tile{background:#fff;border:1px solid #e4e7eb;border-radius:8px;padding:12px 18px;flex:1 1 130px}
.tile b{display:block;font-size:22px;font-variant-numeric:tabular-nums}
.tile span{color:#7b8794;font-size:13px}.tile.bad b{color:#c8453b}
figure{background:#fff;border:1px solid #e4e7eb;border-radius:8px;padding:14px;margin:0 0 16px}
img{width:100%;height:auto;display:block}
table{border-collapse:collapse;background:#fff;border:1px solid #e4e7eb;border-radius:8px;width:100%}
td,th{padding:6px 14px;text-align:right;border-top:1px solid #e4e7eb;font-variant-numeric:tabular-nums}
th:first-child,td:first-child{text-align:left}th{border-top:0;color:#7b8794;font-weight:600;font-size:13px}
"""


def write_report(folder: Path) -> Path:
    """Write ``report.html`` and ``trace.json`` into a ledger folder; returns the page's path.

    A ledger without summary.json (the host was killed) is summarised from its rows and from run.json.

    Raises
    ------
    UserError
        If there is no ledger, one of its files is damaged, or the folder cannot be written.
    """
    rows = read_ledger(folder)
    summary = _summary(folder, rows)
    plots = folder / PLOT_FOLDER
    try:
        plots.mkdir(exist_ok=True)
        names = draw_plots(rows, summary.deadline_ms, plots)
    except OSError as error:
        raise UserError(
            f"the report cannot be written to {folder} ({error.strerror}): copy the ledger elsewhere"
        ) from error
    path = folder / REPORT_HTML
    write_atomic(path, _page(summary, names).encode())
    write_trace(rows, folder / TRACE_JSON)
    return path


def _summary(folder: Path, rows: Sequence[LedgerRow]) -> LedgerSummary:
    path = folder / SUMMARY_JSON
    if not path.exists():
        return _summary_of_killed(folder, rows)
    summary = _read(path, LedgerSummary, "a ledger summary")
    if summary.accepted_wrong is not None:
        return summary
    # written before these were counted
    counted = summarise(rows, **_terms(folder, rows))
    return msgspec.structs.replace(
        summary, accepted_known=counted.accepted_known, accepted_wrong=counted.accepted_wrong
    )


def _summary_of_killed(folder: Path, rows: Sequence[LedgerRow]) -> LedgerSummary:
    """What is known of a run that could not close its books."""
    return summarise(rows, **_terms(folder, rows))


def _terms(folder: Path, rows: Sequence[LedgerRow]) -> dict[str, Any]:
    """What a run without a summary was told; of ledgers older than run.json, what their rows say."""
    path = folder / RUN_JSON
    if path.exists():
        terms = _read(path, RunTerms, "the terms of a run")
        return {
            "started_utc": terms.started_utc,
            "ended": "killed",
            "mode": terms.mode,
            "truth": terms.truth,
            "url": terms.url,
            "timeout_s": terms.timeout_s,
            "deadline_ms": terms.deadline_ms,
        }
    return {
        "started_utc": rows[0].epoch_utc if rows else "",
        "ended": "killed",
        "mode": "realtime" if any(row.send_lag_ms is not None for row in rows) else "lockstep",
        "truth": "unknown",
        "url": "",
        "timeout_s": 0.0,
    }


def _read(path: Path, kind: type[T], what: str) -> T:
    try:
        return msgspec.json.decode(read_regular(path, MOST_BYTES), type=kind)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): make it readable") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{path} is not {what} of this version: {error}") from error


def _text(value: float | None, unit: str, digits: int = 3) -> str:
    if value is None:
        return "&ndash;"
    # thousands are written out: 1362 ms, never 1.36e+03
    return f"{value:.0f}&thinsp;{unit}" if abs(value) >= 10**digits else f"{value:.{digits}g}&thinsp;{unit}"


def _truth(s: LedgerSummary) -> str:
    return "truth not recorded" if s.truth == "unknown" else f"truth {s.truth}"


def _ended(s: LedgerSummary) -> str:
    if s.ended == "killed":
        return "the host was killed: no summary was written"
    return s.ended.replace("_", " ") + (f": {html.escape(s.board_gone)}" if s.board_gone else "")


def _page(s: LedgerSummary, names: Sequence[str]) -> str:
    share = f"{s.accepted / s.sent:.0%}" if s.sent else "&ndash;"
    tiles = [
        (f"{s.sent}", "frames sent"),
        (f"{s.accepted} ({share})", "poses accepted"),
        (f"{s.declined}", "declined"),
        (f"{s.dropped_total}", "dropped"),
        (_text(s.e2e_ms_p50, "ms"), "latency p50"),
        (_text(s.e2e_ms_p99, "ms"), "latency p99"),
        (_text(s.e2e_ms_max, "ms"), "latency max"),
        (_text(s.median_E_T_m, "m"), "median E_T, accepted"),
        (_text(s.median_E_R_deg, "deg"), "median E_R, accepted"),
    ]
    if s.deadline_misses is not None:
        tiles.insert(7, (f"{s.deadline_misses}", f"later than {_text(s.deadline_ms, 'ms')}"))
    tile_html = "".join(f'<div class="tile"><b>{value}</b><span>{name}</span></div>' for value, name in tiles)
    if s.accepted_known:
        bad = " bad" if s.accepted_wrong else ""
        tile_html += (
            f'<div class="tile{bad}"><b>{s.accepted_wrong} of {s.accepted_known}</b>'
            "<span>accepted poses wrong</span></div>"
        )
    figures = "".join(
        f'<figure><img src="{PLOT_FOLDER}/{name}.png" alt="{name}">'
        f"<figcaption>{CAPTIONS[name]}</figcaption></figure>"
        for name in names
    )
    stages = "".join(
        f"<tr><td>{html.escape(t.name)}</td><td>{t.p50_ms:.3f}</td>"
        f"<td>{t.p99_ms:.3f}</td><td>{t.max_ms:.3f}</td></tr>"
        for t in s.stages
    )
    table = (
        "<table><tr><th>board stage</th><th>p50 [ms]</th><th>p99 [ms]</th><th>max [ms]</th></tr>"
        f"{stages}</table>"
        if stages
        else ""
    )
    causes = ", ".join(f"{n} {html.escape(cause)}" for cause, n in s.dropped.items()) or "none"
    board = (
        "no board"
        if s.board is None
        else f"{html.escape(s.board.name)}, method {html.escape(s.board.method)}"
    )
    host = f"{html.escape(s.machine.processor)}, {s.machine.cpus} CPUs, {html.escape(s.machine.system)}"
    link = (
        f"{s.link.packets_sent} packets out, {s.link.packets_received} in, {s.link.packets_corrupt} damaged,"
        f" {s.link.protocol_mistakes} protocol mistake(s), {s.link.sessions} session(s),"
        f" clock exchange {_text(s.link.clock_round_trip_ms, 'ms')} round trip"
    )
    files = f'<a href="{FRAMES_CSV}">{FRAMES_CSV}</a>'
    if s.ended == "killed":
        # what the summary would have said; this machine need not be the run's
        board = host = link = "not recorded"
    else:
        files += f' &middot; <a href="{SUMMARY_JSON}">{SUMMARY_JSON}</a>'
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Flyaround: hardware in the loop</title>
<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body><main>
<h1>Hardware in the loop</h1>
<p class="dim">{html.escape(s.started_utc)} &middot; {s.mode} &middot; {html.escape(s.url)}
&middot; {_truth(s)} &middot; {_ended(s)}</p>
<p class="dim">Board: {board}.
Host: {host}.</p>
<div class="tiles">{tile_html}</div>
<p class="dim">{s.sent} sent = {s.accepted} accepted + {s.declined} declined + {s.dropped_total} dropped
(causes: {causes}).
Link: {link}.</p>
<br>{figures}{table}
<p class="dim">Rows: {files}</p>
</main></body></html>
"""
