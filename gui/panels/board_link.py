"""Panel of the link to a board: session on this flight, answers, latencies and fault injection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.commands.hil import FAULT_S, FAULTS, LISTEN
from flyaround.gui.jobs.estimator_process import known_methods
from flyaround.gui.jobs.hil_session import BIN_EDGES_MS
from flyaround.gui.widgets import Panel
from flyaround.hil.host.truth_policy import access_flaw

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.jobs.hil_session import HilSession

SHOWN_REASONS = 4
SEEN = {"off": style.QUIET, "streaming": style.GOOD}


class BoardLinkPanel(Panel):
    """Controls of a session, and the ledger as it grows."""

    name, title, place, shown = "board-link", "Board link", "left", False

    _url, _flaw = LISTEN, ""
    _method, _fault = "", next(iter(FAULTS))
    _seconds = f"{FAULT_S:g}"

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui, hil = self._w, self._w.imgui, console.jobs.hil
        w.text(f"session: {hil.state}", SEEN.get(hil.state, style.WARN), "state of the session")
        # nothing moves when a session begins: the next click is on the board below
        imgui.begin_disabled(hil.on)
        imgui.set_next_item_width(-1)
        _, self._url = imgui.input_text("##url", hil.url or self._url)
        if imgui.is_item_deactivated_after_edit():
            # not in every frame, because a host's name is looked up
            self._flaw = access_flaw(self._url or LISTEN)
        imgui.end_disabled()
        w.flaw("" if hil.on else self._flaw)
        w.command_tip(console, "hil.start", argument="url")
        start = ("hil.stop",) if hil.on else ("hil.start", self._url)
        w.button(console, *start, width=w.width)
        w.text("After each answer the board is sent a picture of the newest moment.", style.QUIET)
        w.section("Board of this machine")
        methods = known_methods()
        self._method = w.choice(console, "hil.board", self._method or methods[0], methods, argument="method")
        board = ("hil.board-stop",) if hil.board_running else ("hil.board", self._method, self._url)
        w.button(console, *board, width=w.width)
        # above the answers, whose growth must not move it
        w.section("Faults on purpose")
        self._faults(console)
        w.section("Answers")
        self._answers(hil)

    def _answers(self, hil: HilSession) -> None:
        w = self._w
        w.text(f"board: {hil.board_name or 'none'}", style.INK, "what the connected board reports of itself")
        w.row("Pictures", (hil.sent,), "{:d}", "sent since the session began")
        w.row("Accepted", (hil.outcomes["accepted"],), "{:d}", "poses that the board accepts")
        w.row("Declined", (hil.outcomes["declined"],), "{:d}", "answers without a usable pose")
        newest = next((r.reason for r in reversed(hil.rows) if r.reason in hil.declined), "")
        for reason in sorted(hil.declined, key=lambda r: (r != newest, -hil.declined[r]))[:SHOWN_REASONS]:
            tip = "number of declined pictures with this reason; the last one's is on top"
            w.cut_line(f"  {hil.declined[reason]}: {reason}", w.width, style.WARN, tip)
        if hil.cause:
            w.text(hil.cause, style.WARN, "why the last picture was declined, and what to do")
        w.row("Rate", (hil.per_s,), "{:.2f}/s", "answers a second, over five seconds")
        for cause, n in hil.drops.items():
            with w.coloured(style.BAD):
                w.row(f"Lost: {cause}", (n,), "{:d}", "pictures without an answer")
        latencies = hil.latencies_ms()
        if len(latencies):
            middle, most = np.percentile(latencies, [50, 99])
            w.row("Median latency", (middle,), "{:.0f} ms", "from the first byte out to the pose back")
            w.row("99th percentile", (most,), "{:.0f} ms", "latency that 99 of 100 pictures stay below")
            self._distribution(hil)
        poses = [r for r in hil.rows if r.outcome == "accepted" and r.E_R_deg is not None]
        if poses:
            last = poses[-1]
            w.row("Attitude error", (last.E_R_deg or 0.0,), "{:.3f}°", "of the last accepted pose")
            w.row("Position error", (1e3 * (last.E_T_m or 0.0),), "{:.1f} mm", "of the last accepted pose")

    def _distribution(self, hil: HilSession) -> None:
        """Draw answered pictures by latency, on a logarithmic scale of milliseconds."""
        w, implot = self._w, self._w.implot
        counts = hil.latency_counts()
        tip = "pictures by their latency, from the first byte out to the pose back [ms, log scale]"
        with w.plot("latency", 120, tip, ("latency [ms]", "pictures")) as is_open:
            if not is_open:
                return
            filled = np.flatnonzero(counts)
            low, high = BIN_EDGES_MS[max(filled[0] - 2, 0)], BIN_EDGES_MS[min(filled[-1] + 3, len(counts))]
            implot.setup_axis_scale(implot.ImAxis_.x1, implot.Scale_.log10)
            implot.setup_axes_limits(low, high, 0, 1.1 * float(counts.max()), w.imgui.Cond_.always)
            decades = [m * p for p in (1, 10, 100, 1000) for m in (1, 2, 5)] + [10000]
            # a line at the edge would leave the panel
            ticks = [t for t in decades if low <= t <= 0.8 * high]
            if ticks:
                implot.setup_axis_ticks(implot.ImAxis_.x1, [float(t) for t in ticks], [str(t) for t in ticks])
            steps = np.append(counts, 0.0)
            edges, heights = np.array(BIN_EDGES_MS), np.ascontiguousarray(steps)
            implot.plot_stairs("pictures", edges, heights, w.curve(style.ACCENT))

    def _faults(self, console: Console) -> None:
        w, imgui = self._w, self._w.imgui
        names = {kind: kind.replace("_", " ") for kind in FAULTS}
        self._fault = w.choice(console, "hil.fault", self._fault, list(names), argument="kind", shown=names)
        w.text(FAULTS[self._fault][1], style.QUIET)
        imgui.set_next_item_width(min(8 * imgui.get_font_size(), 0.4 * w.width))
        self._seconds = w.typed("seconds", self._seconds, console.table["hil.fault"].arguments[1], "Fault")
        imgui.same_line()
        w.one_line("s", style.QUIET)
        w.flow(6 * imgui.get_font_size(), first=False)
        on = console.jobs.hil.on
        w.button(console, "hil.fault", self._fault, self._seconds, label="Inject fault", enabled=on)
        for kind, n in console.jobs.hil.struck.items():
            w.row(names[kind], (n,), "{:d}", "pictures or answers affected by the fault")
