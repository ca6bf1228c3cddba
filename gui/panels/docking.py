"""Panel of the docking figures with their limits, hold points with go and no-go, abort, and the last contact."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.texts import NOTES, texts
from flyaround.gui.views.docking_hud import DISTANCE, FIGURE_TIPS, status
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.chaser_control import GUARDS
from flyaround.simulator.piloting.docking_figures import PRESETS, judge
from flyaround.simulator.piloting.readouts import mission_time, speed_text

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.simulator.piloting.docking_figures import JudgedFigure

STATES = texts("limits")
NAMED = texts("guards")
LIMITS = {name: limits.title for name, limits in PRESETS.items()}
# colours of the decisions at a hold point
DECISION_COLOURS = {
    "open": style.INK,
    "go": style.WITHIN,
    "no-go": style.OUTSIDE,
    "passed": style.QUIET,
    "behind": style.QUIET,
}


class DockingPanel(Panel):
    """Figures of the approach to the port, and the limits that decide a docking."""

    name, title, place, shown = "docking", "Docking", "left", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, session = self._w, console.session
        docking, steering = session.craft.docking, session.craft.steering
        text, colour = status(console)
        # one line, because buttons stand below it
        w.cut_line(text, w.width, colour, "active guidance, and what it waits for")
        primary = "" if docking.docked or docking.hold_points.next is None else "docking.go"
        primary = primary if steering.autopilot else "docking.approach"
        w.buttons(console, ("docking.approach",), 1, primary)
        w.buttons(console, ("docking.go", "docking.no-go"), 2, primary)
        w.button(console, "time.next-hold-point", width=w.width)
        if steering.keep_out is not None:
            w.choice(console, "docking.keep-out", steering.guard, list(GUARDS), shown=NAMED)
        w.switch(console, "overlay.docking", "Display over the view")
        figures = docking.figures(session.craft.chaser, session.flight)
        w.section(docking.port.name.capitalize())
        w.row("Distance", (figures.axial_m,), "{:z.2f} m", DISTANCE)
        w.row("Delta-v spent", (speed_text(steering.propellant.delta_v_m_s),), "{}", NOTES["delta-v"])
        self._table(judge(figures, docking.limits, docking.corridor_deg))
        self._limits(console)
        self._points(console)
        self._contacts(console)

    def _table(self, rows: tuple[JudgedFigure, ...]) -> None:
        w = self._w
        cells = []
        for row in rows:
            short = row.name.replace("offset ", "").replace("rate ", "").replace(" rate", "")
            now, colour = f"{row.text}{style.LIMIT_MARKS[row.state]}", style.LIMIT_COLORS[row.state]
            state = f"{row.name} now [{row.unit}]; {STATES[row.state]}"
            most = f"limit at this distance [{row.unit}]"
            head = partial(w.text, f"{short.capitalize()} [{row.unit}]", style.QUIET, FIGURE_TIPS[row.name])
            limit = partial(w.text, f"{row.limit:.2g}", style.QUIET, most)
            cells.append((head, partial(w.text, now, colour, state), limit))
        w.table("figures", (0.38, 0.43, 0.19), cells, ("Figure", "Now", "Limit"))

    def _limits(self, console: Console) -> None:
        w, now = self._w, console.session.craft.docking.limits
        w.field(
            "Limits",
            f"{now.source}; closing and offsets grow with distance; over: up to twice a limit, out: beyond",
            0.7,
        )
        w.choice(console, "docking.limits", now.name, list(PRESETS), shown=LIMITS)
        w.button(console, "docking.axis-here", width=w.width)

    def _points(self, console: Console) -> None:
        w, session = self._w, console.session
        w.section("Hold points")
        points = session.craft.docking.hold_points.points
        if not points:
            w.text("none: the approach begins inside the last hold point", style.QUIET)
        following = session.craft.docking.hold_points.next
        w.imgui.push_font(w.window.figure_font, 0.0)
        for p in points:
            here = following is not None and p.name == following.name
            text = f"{'>' if here else ' '} {p.name} {p.axial_m:5g} m  {p.decision}"
            w.text(text, DECISION_COLOURS[p.decision], NOTES["hold-point"])
        w.imgui.pop_font()
        if following is not None:
            whys = session.craft.docking.not_ready(session.craft.chaser, session.flight)
            w.text("Go waits for:" if whys else "ready for Go", style.INK)
            for why in whys:
                w.text(f"  {why}", style.QUIET, "why go would be refused now")

    def _contacts(self, console: Console) -> None:
        w = self._w
        contact = console.session.craft.docking.contact
        if contact is None:
            return
        w.section("Contact")
        colour = style.WITHIN if contact.docked else style.OUTSIDE
        docked = "docked" if contact.docked else "no docking"
        w.text(f"{mission_time(contact.t_s)}: {docked}", colour, "time of the last contact since the start")
        w.text(f"score {contact.score} of 100", colour, NOTES["score"])
        for miss in contact.misses:
            w.text(miss, style.OUTSIDE, "why the contact did not dock: figure at contact, and its limit")
