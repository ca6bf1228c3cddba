"""Strips above the status line: clock, rate, scrubber, hand control and a guarded abort; and background jobs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.commands.timeline import clock
from flyaround.gui.icons import labelled
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.widgets import Widgets
from flyaround.simulator.piloting.clock import RATES

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.flight_history import Timeline

NARROW_EM = 56
"""Window width, in text heights, below which the strip shortens its texts."""
GUARD_MS = 3000
"""Time for which the open guard of the abort button waits for the second click [ms]."""


class TransportStrip:
    """Buttons at fixed positions, the same in every layout.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)
        self._opened_ms = -GUARD_MS

    def draw(self, console: Console) -> None:
        """Draw into the current side bar."""
        w, imgui = self._w, self._w.imgui
        em, session = imgui.get_font_size(), console.session
        paused = session.clock.paused
        look = ("Play", "play") if paused else ("Pause", "time.pause")
        w.button(console, "time.pause", label=look[0], icon=look[1], width=5.2 * em, fill=style.PRIMARY)
        imgui.same_line()
        w.button(console, "time.step", label="Step", width=4.4 * em)
        imgui.same_line()
        # in a narrow window texts make room for the scrubber
        narrow = imgui.get_window_width() < NARROW_EM * em
        self._rate(console, (5 if narrow else 7) * em)
        imgui.same_line()
        timeline = session.look_back.timeline
        end_s = max(timeline.end_s, session.t_s, 0.1)
        text = clock(session.t_s) + ("" if narrow else f" of {clock(end_s)[2:]}")
        imgui.align_text_to_frame_padding()
        w.one_line(text, style.WARN if session.look_back.active else style.INK)
        w.tip(
            "where one is, and the end of what was flown [h:min:s since the start]; yellow while looking back"
        )
        imgui.same_line()
        right = 17 * em
        self.scrubber(console, timeline, end_s, max(w.width - right, em))
        imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - right + 0.5 * em)
        on = console.hand.armed
        look = ("HAND: ON", "hand-on") if on else ("HAND: OFF", "hand-off")
        fill = style.WARN if on else style.EDGE
        w.button(console, "steer.arm", label=look[0], icon=look[1], width=8 * em, fill=fill)
        imgui.same_line()
        self._abort(console, 7 * em)

    def _rate(self, console: Console, width: float) -> None:
        """Draw the slider of the clock's rate, on a logarithmic scale."""
        w, imgui, flight = self._w, self._w.imgui, console.session.clock
        k = min(range(len(RATES)), key=lambda i: abs(math.log(RATES[i] / flight.rate)))
        imgui.set_next_item_width(width)
        changed, new_k = imgui.slider_int("##rate", k, 0, len(RATES) - 1, f"{flight.rate:g}x")
        w.about(console, "time.rate")
        if changed and new_k != k:
            console.do("time.rate", f"{RATES[new_k]:g}")

    def scrubber(self, console: Console, timeline: Timeline, end_s: float, width: float) -> None:
        """Draw a slider over the flight, with marks of bookmarks, burns and discarded futures."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(width)
        flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.no_round_to_format
        changed, t_s = imgui.slider_float("##t", console.session.t_s, 0.0, end_s, "", flags)
        w.tip(f"{console.table['timeline.seek'].about()}\ndrag to look back, Ctrl and click types a time")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        draw, pad = imgui.get_window_draw_list(), 6.0 * w.window.scale
        span = max(high.x - low.x - 2 * pad, 1.0)
        marks = [(mark.t_s, style.GOOD) for mark in timeline.bookmarks]
        marks += [(timeline.left_s[0], style.WARN)] if timeline.left_s is not None else []
        marks += [(contact.t_s, style.BAD) for contact in console.session.craft.docking.contacts]
        marks += [(burn.start_s, style.ACCENT) for burn in console.session.craft.steering.burns.burns]
        for at_s, colour in marks:
            if at_s <= end_s:
                x = low.x + pad + span * at_s / end_s
                draw.add_line(w.vec(x, low.y), w.vec(x, high.y), w.color(colour), 2.0)
        if changed:
            console.do("timeline.seek", max(round(t_s, 3), 0.0))

    def _abort(self, console: Console, width: float) -> None:
        """Abort by two clicks, of which the first opens the guard for three seconds; the key needs one press."""
        w = self._w
        opened = console.clock_ms - self._opened_ms < GUARD_MS
        fill = style.BAD if opened else style.GUARDED
        label = labelled("docking.abort", "ABORT NOW" if opened else "ABORT")
        if w.filled_button(f"{label}###abort", width, fill):
            if opened:
                console.do("docking.abort")
            else:
                console.say("abort: click once more within three seconds, or press Del")
            self._opened_ms = -GUARD_MS if opened else console.clock_ms
        w.tip(
            f"{console.table['docking.abort'].about()}\ntwo clicks within three seconds; the key needs one press"
        )


class JobStrip:
    """A line for background jobs, each with its progress and a button that ends it.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)

    def draw(self, console: Console) -> None:
        """Draw into the current side bar."""
        w, imgui = self._w, self._w.imgui
        for k, job in enumerate(running_jobs(console.jobs)):
            if k:
                imgui.same_line(0, imgui.get_font_size())
            imgui.align_text_to_frame_padding()
            w.one_line(job.text, style.ACCENT)
            if job.share is not None:
                imgui.same_line()
                imgui.progress_bar(job.share, w.vec(6 * imgui.get_font_size(), 0), f"{100 * job.share:.0f} %")
            if job.end:
                imgui.same_line()
                w.button(console, job.end, label="End")
