"""Strips above the status line: clock, rate, scrubber, hand control and a guarded abort; and background jobs."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.icons import labelled
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.texts import left_text
from flyaround.gui.usable import is_usable
from flyaround.gui.widgets import Widgets
from flyaround.simulator.piloting.clock import RATES
from flyaround.simulator.piloting.readouts import duration_text, mission_time

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.flight_history import Timeline

NARROW_EM = 72
"""Window width, in text heights, below which the strip shortens its texts."""
FIRST_GUESS_S = 1.0  # time after which the time left is estimated
SILENT_S = 2.0  # time after which a job that has given nothing yet tells how long it has been at work
JOB_COLUMNS = 3  # columns of the line of jobs; more jobs get narrower ones
STEPS_S = (1, 5, 10, 30, 60, 300, 600, 1800, 3600, 7200, 21_600, 86_400)
"""Steps of the slider's scale [s]."""
HAND = {"by hand": "ON", "docked": "DOCKED"}
"""State of armed hand control by what flies the chaser; armed only, while guidance or the autopilot does."""
GUARD_MS = 5000
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

    def draw(self, console: Console) -> None:
        """Draw into the current side bar."""
        w, imgui = self._w, self._w.imgui
        em, session, paused = imgui.get_font_size(), console.session, console.session.clock.paused
        look = ("Play", "play") if paused else ("Pause", "time.pause")
        w.button(console, "time.pause", label=look[0], icon=look[1], width=5.2 * em, on=paused)
        imgui.same_line()
        w.button(console, "time.step", width=4.4 * em)
        imgui.same_line()
        # in a narrow window texts make room for the scrubber
        narrow = imgui.get_window_width() < NARROW_EM * em
        self._rate(console, (5 if narrow else 10) * em)
        imgui.same_line()
        timeline = session.look_back.timeline
        end_s = max(timeline.end_s, session.t_s, 0.1)
        text = mission_time(session.t_s) + ("" if narrow else f" of {mission_time(end_s)[2:]}")
        imgui.align_text_to_frame_padding()
        w.one_line(text, style.WARN if session.look_back.active else style.INK)
        w.tip("time shown, and end of the recorded flight [h:min:s since the start]; yellow: looking back")
        imgui.same_line()
        right = (23.5 if narrow else 27) * em
        self.scrubber(console, timeline, end_s, max(w.width - right, em))
        imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - right + 0.5 * em)
        # always in place, grey at the end of the flight: nothing moves when one looks back
        for name, label, width in (
            ("timeline.end", "", 2.2),
            ("timeline.fly-on", "" if narrow else "Fly on", 2.2 if narrow else 5.7),
        ):
            w.button(console, name, label=label, width=width * em, enabled=is_usable(console, name))
            imgui.same_line()
        on = console.hand.armed
        state = HAND.get(console.flown_by, "ARMED") if on else "OFF"
        look = f"HAND: {state}", "hand-on" if on else "hand-off"
        fill = style.WARN if state == "ON" else style.EDGE
        w.button(console, "steer.arm", label=look[0], icon=look[1], width=8 * em, fill=fill)
        imgui.same_line()
        self._abort(console, 8 * em)

    def _rate(self, console: Console, width: float) -> None:
        """Draw the slider of the clock's rate, on a logarithmic scale."""
        w, imgui, flight = self._w, self._w.imgui, console.session.clock
        k = min(range(len(RATES)), key=lambda i: abs(math.log(RATES[i] / flight.rate)))
        imgui.set_next_item_width(width)
        text = "jump" if flight.jump else f"{flight.rate:g}x"
        changed, new_k = imgui.slider_int("##rate", k, 0, len(RATES) - 1, "", imgui.SliderFlags_.no_input)
        if imgui.is_item_active() and imgui.is_mouse_double_clicked(0):
            # let go, or the slider would follow the pointer again
            imgui.internal.clear_active_id()
            changed, new_k = True, RATES.index(1.0)
        w.tip(f"{console.table['time.rate'].help}; a double click sets 1x\ntime.rate RATE")
        # beside the grip, which would cover it
        low, high, pad = imgui.get_item_rect_min(), imgui.get_item_rect_max(), imgui.get_style().frame_padding
        right = high.x - pad.x - imgui.calc_text_size(text).x
        at = w.vec(right if k < len(RATES) / 2 else low.x + pad.x, low.y + pad.y)
        imgui.get_window_draw_list().add_text(at, w.color(style.INK), text)
        if changed and new_k != k:
            console.do("time.rate", f"{RATES[new_k]:g}")

    def scrubber(self, console: Console, timeline: Timeline, end_s: float, width: float) -> None:
        """Draw a slider over the flight, with a scale, eclipses and the marks of what happened."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(width)
        flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.no_round_to_format
        changed, t_s = imgui.slider_float("##t", console.session.t_s, 0.0, end_s, "", flags)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        draw, pad = imgui.get_window_draw_list(), 6.0 * w.window.scale
        span = max(high.x - low.x - 2 * pad, 1.0)

        def x_of(t_s: float) -> float:
            return float(low.x + pad + span * min(t_s / end_s, 1.0))

        for start_s, dark_until_s in console.session.eclipses_s:
            left, right = x_of(start_s), max(x_of(dark_until_s), x_of(start_s) + 2.0)
            draw.add_rect_filled(w.vec(left, high.y - 5.0), w.vec(right, high.y), w.color(style.SHADOW))
        self._scale(end_s, x_of)
        session = console.session
        marks = [(m.t_s, style.GOOD, m.note or "bookmark") for m in timeline.bookmarks]
        branches = "the flight branches off here: Flight > Timeline > Swap future"
        marks += [(t, style.WARN, branches) for t in (timeline.left_s or ())[:1]]
        marks += [(m.t_s, style.BAD if m.kind == "contact" else style.INK, m.text) for m in session.marks]
        marks += [(b.start_s, style.ACCENT, "burn") for b in session.craft.steering.burns.burns]
        near = ["drag to look back, Ctrl+click to type a time [s]"]
        for at_s, colour, text in marks:
            if at_s <= end_s:
                x = x_of(at_s)
                draw.add_line(w.vec(x, low.y), w.vec(x, high.y), w.color(colour), 2.0)
                if abs(imgui.get_mouse_pos().x - x) < pad:
                    near.insert(0, f"{mission_time(at_s)}  {text}")
        w.tip("\n".join(near))
        if changed:
            console.do("timeline.seek", max(round(t_s, 3), 0.0))

    def _scale(self, end_s: float, x_of: Callable[[float], float]) -> None:
        """Write times into the slider, the last item: both ends, and round times between them."""
        w, imgui = self._w, self._w.imgui
        at_text = partial(mission_time, whole=True)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.push_font(w.window.text_font, 0.75 * imgui.get_style().font_size_base)
        room = 1.6 * imgui.calc_text_size("T+00:00:00").x
        step = next((s for s in STEPS_S if x_of(s) - x_of(0.0) > room), end_s)
        last = imgui.calc_text_size(at_text(end_s)).x
        times = {0.0: 0.0, end_s: 1.0}
        if high.x - low.x > 3 * room:
            times |= dict.fromkeys(np.arange(step, end_s - 0.6 * step, step).tolist(), 0.5)
        for t_s, share in times.items():
            width = imgui.calc_text_size(at_text(t_s)).x
            x = x_of(t_s) - share * (width + 20.0 * w.window.scale * (share == 1.0))
            if share == 1.0 or x + width < x_of(end_s) - last - 30.0:
                y = (low.y + high.y - imgui.get_font_size()) / 2
                imgui.get_window_draw_list().add_text(w.vec(x, y), w.color(style.QUIET), at_text(t_s))
        imgui.pop_font()

    def _abort(self, console: Console, width: float) -> None:
        """Abort by two clicks, of which the first opens the guard for five seconds; the key needs one press."""
        w, hand, steering = self._w, console.hand, console.session.craft.steering
        opened = console.clock_ms < hand.abort_by_ms
        if not opened and hand.abort_by_ms:
            hand.abort_by_ms = 0
            text = "not aborted: no second click came within five seconds"
            console.say(text, of="docking.abort", over=lambda: bool(hand.abort_by_ms or steering.aborting))
        fill = style.BAD if opened or steering.aborting else style.GUARDED
        label = "ABORT? again" if opened else labelled("docking.abort", "ABORT")
        if w.filled_button(f"{label}###abort", width, fill):
            if opened:
                console.do("docking.abort")
            hand.abort_by_ms = 0 if opened else console.clock_ms + GUARD_MS
        tip = f"retreats to {steering.retreat_to_m:.3g} m from the target; farther away, guidance ends\ntwo clicks"
        w.tip(
            f"{console.table['docking.abort'].hover_text()}\n{tip} within five seconds; the key needs one press"
        )


class JobStrip:
    """A line for background jobs, which is always there, so that nothing moves when a job begins or ends.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)
        self._columns: dict[str, tuple[int, float]] = {}
        """Column of each job, which it keeps until it ends, and the time when it began [s]."""

    def draw(self, console: Console) -> None:
        """Draw into the current side bar."""
        w, imgui = self._w, self._w.imgui
        opening, now_s = console.opener.name if console.opener.is_busy() else "", imgui.get_time()
        jobs = {job.end: job for job in running_jobs(console.jobs, opening, console.session)}
        self._columns = {name: column for name, column in self._columns.items() if name in jobs}
        columns = max([JOB_COLUMNS, *(column + 1 for column, _ in self._columns.values())])
        left, width = imgui.get_cursor_pos_x(), w.width / columns
        imgui.align_text_to_frame_padding()
        w.one_line("" if jobs else "no job runs", style.QUIET)
        for name, job in jobs.items():
            free = set(range(len(jobs) + JOB_COLUMNS)) - {column for column, _ in self._columns.values()}
            column, began_s = self._columns.setdefault(name, (min(free), now_s))
            imgui.same_line(left + column * width)
            # the estimator's button also starts it
            title = "Stop estimating" if name == "estimator.run" else console.table[name].title
            button = w.button_width(labelled("film.stop", title))
            spent_s, text = now_s - began_s, job.text
            if job.share and spent_s > FIRST_GUESS_S:
                text += left_text(spent_s * (1 - job.share) / job.share)
            elif job.silent and spent_s > SILENT_S:
                text += f", {duration_text(spent_s)}"
            w.cut_line(text, width - button - 1.5 * imgui.get_font_size(), style.ACCENT, typing=True)
            if job.share is not None:
                low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
                end = w.vec(low.x + job.share * (high.x - low.x), high.y + 3.0)
                imgui.get_window_draw_list().add_rect_filled(w.vec(low.x, high.y), end, w.color(style.ACCENT))
            imgui.same_line(left + (column + 1) * width - button - imgui.get_font_size())
            w.button(console, name, label=title, icon="film.stop")
