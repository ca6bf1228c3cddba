"""Report of a run, generated from its ledger folder: one page with its plots."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.hil.host.closed_loop_plots import plot_closed_loop
from flyaround.hil.host.closed_loop_run import STEPS_CSV, read_steps
from flyaround.hil.host.ledger.frames_csv import FRAMES_CSV, read_ledger
from flyaround.hil.host.ledger.run_terms import RunTerms, read_terms
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary, percentile, read_summary, summarise
from flyaround.hil.host.link_process.ipc import LinkTotals
from flyaround.hil.host.recording.chrome_trace import write_trace
from flyaround.hil.host.report_plots import draw_plots
from flyaround.simulator.reports.markup import Markup, element, markup
from flyaround.simulator.reports.page import Page, key_figures, link, note, plot, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.host.ledger.summary import ClosedLoopFigures

REPORT_HTML = "report.html"
TRACE_JSON = "trace.json"

# Maximum number of rows in the table of impossible times.
MAX_TIME_FAULTS = 20

WRONG_LABEL = "accepted poses wrong"
TIME_FAULT_LABEL = "answers with impossible board times"

LATE_LABEL = "not rendered in time"
INSIDE_LABEL = "periods inside the sphere"

CAPTIONS = {
    "latency": "From the first byte of the frame to the pose received, on the link process's monotonic clock.",
    "timeline": "Every frame in order; a red line is a frame without an answer, a red dot an accepted pose that is"
    " wrong.",
    "jitter": "Change of latency from one answer to the next; in real time also the delay of sending.",
    "camera": "Age of mid-exposure when the estimator began; in real time also the error of the camera's constant"
    " latency, over all frames.",
    "drops": "Each stroke is a frame. Faults were deliberate; their effect on the frame is its outcome.",
    "outcomes": "Each frame that was offered to the link has exactly one outcome.",
    "stages": "Medians of stages do not add up to the median of the whole; link times depend on the clock offset.",
    "closed loop": "The chaser in the target's LVLH frame, and the true errors of the filter's estimate; shaded while"
    " guidance holds or aborts.",
    "errors": "Relative to the truth known to the host; an accepted pose beyond 5 deg or 5 % of the range is wrong.",
}


def write_report(folder: Path) -> Path:
    """Write ``report.html`` and ``trace.json`` into a ledger folder.

    A ledger without summary.json, because the host was killed, is summarised from its rows and run.json.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    UserError
        If there is no ledger, one of its files is damaged, or the folder cannot be written.
    """
    steps = read_steps(folder)
    # a closed loop on the truth sends no frames
    rows = [] if steps and not (folder / FRAMES_CSV).exists() else read_ledger(folder)
    summary = _summary(folder, rows)
    head = _record(read_terms(folder), summary)
    page = _page(summary, rows, draw_plots(rows, summary.deadline_ms), steps, head).write(
        folder / REPORT_HTML
    )
    write_trace(rows, folder / TRACE_JSON)
    return page


def _summary(folder: Path, rows: Sequence[FrameRecord]) -> LedgerSummary:
    if not (folder / SUMMARY_JSON).exists():
        # the run was killed before writing it
        return summarise(rows, **_terms(folder, rows))
    summary = read_summary(folder)
    if summary.accepted_wrong is not None:
        return summary
    # an older version wrote it without these counts
    recount = summarise(rows, **_terms(folder, rows))
    return msgspec.structs.replace(
        summary, accepted_known=recount.accepted_known, accepted_wrong=recount.accepted_wrong
    )


def _terms(folder: Path, rows: Sequence[FrameRecord]) -> dict[str, Any]:
    """Return the settings of a run without a summary; from the rows for ledgers older than run.json."""
    terms = read_terms(folder)
    if terms is not None:
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


def _record(terms: RunTerms | None, s: LedgerSummary) -> Markup:
    """Return the table of scenario, software and board; empty if the run did not record it."""
    if terms is None or terms.scenario is None or terms.versions is None:
        return markup()
    scenario, v, board = terms.scenario, terms.versions, s.board or terms.board
    lines = [
        ("scenario", f"{scenario.name}, SHA-256 {scenario.sha256}"),
        ("seed", str(terms.seed)),
        ("target", f"{terms.target}, model {terms.target_sha256}"),
        ("faults", _named_faults(terms)),
        (
            "software",
            f"flyaround {v.flyaround}, Python {v.python}, numpy {v.numpy}, OpenCV {v.opencv}"
            + (f", rendered by {v.gl_renderer}" if v.gl_renderer else ""),
        ),
    ]
    if board is not None:
        model = f"model {board.model or 'unnamed'} {board.model_sha256}".rstrip()
        lines.append(("board", f"{board.name}, method {board.method}, {model}"))
    if terms.sun_sent:
        lines.append(("sent to the board", "direction to the Sun, with each frame"))
    if terms.command:
        lines.append(("command", shlex.join(terms.command)))
    text = element(
        "details",
        element("summary", "text of the scenario"),
        element("div", element("pre", scenario.text), class_="scroll"),
    )
    return markup(table(("configuration", ""), lines), text)


def _named_faults(terms: RunTerms) -> str:
    faults = terms.faults
    kinds = [fault.name for fault in (*faults.camera, *faults.line)]
    return f"{', '.join(kinds)}; seed {faults.seed}" if kinds else "none"


def _text(value: float | None, unit: str, digits: int = 3) -> str:
    if value is None:
        return "\N{EN DASH}"
    # all digits of large numbers: 1362 ms, not 1.36e+03
    figure = f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"
    return f"{figure}\N{THIN SPACE}{unit}"


def _truth(s: LedgerSummary) -> str:
    return "truth not recorded" if s.truth == "unknown" else f"truth {s.truth}"


def _ended(s: LedgerSummary) -> str:
    if s.ended == "killed":
        return "the host was killed: no summary was written"
    return s.ended.replace("_", " ") + (f": {s.board_gone}" if s.board_gone else "")


def _drift(s: LedgerSummary) -> str:
    if s.link.clock_drift_ppm is None or s.link.clock_drift_ppm_sigma is None:
        return "\N{EN DASH}"
    return f"{s.link.clock_drift_ppm:.3g} \N{PLUS-MINUS SIGN} {s.link.clock_drift_ppm_sigma:.2g} ppm"


TIMES = (
    ("end to end", "e2e_ms"),
    ("age when used", "staleness_ms"),
    ("error of the camera's latency", "handover_error_ms"),
    ("delay of sending", "send_lag_ms"),
    ("drawing", "render_ms"),
    ("link out", "uplink_ms"),
    ("waiting on the board", "board_wait_ms"),
    ("on the board", "board_total_ms"),
    ("link back", "downlink_ms"),
)


def _times(rows: Sequence[FrameRecord]) -> Markup:
    """Return the percentiles of every time of a frame, over the frames that have it."""
    lines = []
    for label, name in TIMES:
        ms = [value for row in rows if (value := getattr(row, name)) is not None]
        if ms:
            percentiles = [percentile(ms, q) for q in (50, 95, 99, 100)]
            lines.append((label, str(len(ms)), *(f"{value:.3f}" for value in percentiles)))
    if not lines:
        return markup()
    return table(("time", "frames", "p50 [ms]", "p95 [ms]", "p99 [ms]", "max [ms]"), lines)


def _faults(rows: Sequence[FrameRecord]) -> Markup:
    """Return the outcomes of frames with deliberate faults."""
    names = sorted({name for row in rows for name in row.faults})
    outcomes = sorted({row.outcome for row in rows if row.faults})
    lines = []
    for name in names:
        hit_outcomes = [row.outcome for row in rows if name in row.faults]
        lines.append(
            (name, str(len(hit_outcomes)), *(str(hit_outcomes.count(outcome)) for outcome in outcomes))
        )
    return table(("deliberate fault", "frames", *outcomes), lines)


def _loop(c: ClosedLoopFigures, steps: dict[str, list[str]]) -> Markup:
    """Return the section of a closed loop: its result and plots."""
    figures = [
        (c.outcome, "approach"),
        (_text(c.final_error_m, "m"), "from the hold point"),
        (_text(c.final_error_deg, "deg"), "attitude error"),
        (_text(c.min_range_m, "m"), "nearest"),
        (f"{c.keep_out_violations}", INSIDE_LABEL),
        (_text(c.delta_v_m_s, "m/s"), "spent"),
    ]
    failed = [
        *(["approach"] if c.outcome != "arrived" else []),
        *([INSIDE_LABEL] if c.keep_out_violations else []),
    ]
    reason = note(f"{c.outcome} after {_text(c.duration_s, 's')}" + (f": {c.reason}" if c.reason else ""))
    loop_plot = plot(plot_closed_loop(steps), CAPTIONS["closed loop"], alt="closed loop") if steps else None
    return markup(key_figures(figures, bad=failed), reason, loop_plot)


def _mistakes(s: LedgerSummary) -> str:
    kinds = "; ".join(f"{n} x {kind}" for kind, n in s.link.mistakes.items())
    return f"{s.link.protocol_mistakes} protocol violation(s){f' ({kinds})' if kinds else ''}"


def _page(
    s: LedgerSummary,
    rows: Sequence[FrameRecord],
    plots: dict[str, bytes],
    steps: dict[str, list[str]],
    head: Markup,
) -> Page:
    board = "no board" if s.board is None else f"{s.board.name}, method {s.board.method}"
    host = f"{s.machine.processor}, {s.machine.cpus} CPUs, {s.machine.system}"
    line = (
        f"{s.link.packets_sent} packets out, {s.link.packets_received} in, of which {s.link.packets_corrupt} damaged;"
        f" {_mistakes(s)}, {s.link.sessions} session(s),"
        f" clock exchange {_text(s.link.clock_round_trip_ms, 'ms')} round trip at best,"
        f" {_text(s.link.clock_round_trip_ms_p99, 'ms')} p99,"
        f" offset within {_text(s.link.clock_offset_bound_ms, 'ms')}, drift {_drift(s)}"
    )
    if s.link == LinkTotals():
        line = "not recorded"
    files = [link(FRAMES_CSV)] if rows or not steps else []
    if steps:
        files.append(link(STEPS_CSV))
    if s.ended == "killed":
        # unknown without a summary; this machine need not be the run's
        board = host = line = "not recorded"
    else:
        files.append(link(SUMMARY_JSON))
    causes = ", ".join(f"{n} {cause}" for cause, n in s.dropped.items()) or "none"
    page = Page("Flyaround: hardware in the loop", "Hardware in the loop", width_px=1080)
    page.add(note(_dotted(s.started_utc, s.mode, s.url, _truth(s), _ended(s))))
    page.add(note(f"Board: {board}. Host: {host}."))
    page.add(head)
    if s.closed_loop is not None:
        page.add(_loop(s.closed_loop, steps))
    if not rows and steps:
        page.add(
            note(
                f"No frames: poses were {s.closed_loop.pose if s.closed_loop else 'the truth'}'s. Decisions: ",
                _dotted(*files),
            )
        )
        return page
    page.add(_key_figures(s))
    page.add(
        note(
            f"{s.sent} sent = {s.accepted} accepted + {s.declined} declined + {s.dropped_total} dropped"
            f" (causes: {causes}). Link: {line}."
        )
    )
    page.add(_times(rows))
    faulty = [row for row in rows if row.time_fault]
    if faulty:
        lines = [(str(row.frame_id), row.time_fault) for row in faulty[:MAX_TIME_FAULTS]]
        page.add(
            note(f"The board reported impossible times for {len(faulty)} frames; they are omitted above.")
        )
        page.add(table(("frame", "problem"), lines))
    if any(row.faults for row in rows):
        page.add(_faults(rows))
    page.add(element("br"), [plot(png, CAPTIONS[name], alt=name) for name, png in plots.items()])
    if s.stages:
        stages = [(t.name, *(f"{ms:.3f}" for ms in (t.p50_ms, t.p99_ms, t.max_ms))) for t in s.stages]
        page.add(table(("board stage", "p50 [ms]", "p99 [ms]", "max [ms]"), stages))
    page.add(note("Rows: ", _dotted(*files)))
    return page


def _dotted(*cells: str) -> Markup:
    parts = [part for part in cells if part]
    return markup(parts[0], *((" \N{MIDDLE DOT} ", part) for part in parts[1:]))


def _key_figures(s: LedgerSummary) -> Markup:
    share = f"{s.accepted / s.sent:.0%}" if s.sent else "\N{EN DASH}"
    figures = [
        (f"{s.sent}", "frames sent"),
        (f"{s.accepted} ({share})", "poses accepted"),
        (f"{s.declined}", "declined"),
        (f"{s.dropped_total}", "dropped"),
        (_text(s.e2e_ms_p50, "ms"), "latency p50"),
        (_text(s.e2e_ms_p95, "ms"), "latency p95"),
        (_text(s.e2e_ms_p99, "ms"), "latency p99"),
        (_text(s.e2e_ms_max, "ms"), "latency max"),
        (_text(s.median_E_T_m, "m"), "median E_T, accepted"),
        (_text(s.median_E_R_deg, "deg"), "median E_R, accepted"),
    ]
    bad = [label for label, n in ((WRONG_LABEL, s.accepted_wrong), (LATE_LABEL, s.late)) if n]
    # in lockstep campaigns, wall-clock times are not kept
    if s.e2e_ms_p50 is None and s.accepted + s.declined:
        figures = [figure for figure in figures if not figure[1].startswith("latency")]
    if s.deadline_misses is not None:
        late_label = f"not answered within {_text(s.deadline_ms, 'ms')}"
        figures.insert(8, (f"{s.deadline_misses}", late_label))
        bad += [late_label] if s.deadline_misses else []
    if s.staleness_ms_p50 is not None:
        figures.append((_text(s.staleness_ms_p50, "ms"), "age when used, p50"))
        figures.append((_text(s.staleness_ms_p99, "ms"), "age when used, p99"))
    if s.handover_error_ms_p99 is not None:
        figures.append(
            (_text(s.handover_error_ms_p99, "ms"), f"error of {_text(s.latency_ms, 'ms')} latency, p99")
        )
    if s.late:
        figures.append((f"{s.late}", LATE_LABEL))
    if s.time_faults:
        figures.append((f"{s.time_faults}", TIME_FAULT_LABEL))
        bad.append(TIME_FAULT_LABEL)
    if s.accepted_known:
        figures.append((f"{s.accepted_wrong} of {s.accepted_known}", WRONG_LABEL))
    return key_figures(figures, bad=bad)
