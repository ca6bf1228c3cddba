"""The two lines at the bottom of the window: master caution, newest messages, rates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Widgets
from flyaround.simulator.piloting.docking_watch import REMEDY

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface

ANSWER_MS = 4000
"""Least time for which an answer to the operator stays before news of the flight replace it."""


class StatusLine:
    """The two lines at the bottom of one window.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)
        self._flaw = "", 0
        """The typed value that is refused, and the number of messages when it was."""

    def draw(self, console: Console) -> None:
        """Draw into the current frame."""
        imgui, w = self._w.window.imgui, self._w
        flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_saved_settings
        padding = imgui.get_style().window_padding
        low = w.vec(padding.x, 0.3 * padding.y)
        imgui.push_style_var(imgui.StyleVar_.window_padding, low)
        imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*style.RAISED))
        height = imgui.get_text_line_height() + w.line + 2 * low.y
        if imgui.internal.begin_viewport_side_bar(
            "status", imgui.get_main_viewport(), imgui.Dir.down, height, flags
        ):
            self._master_caution(console)
            imgui.same_line()
            lifted = console.session.craft.steering.guard == "lifted"
            if lifted or any(REMEDY in m.text for m in console.messages.waiting):
                guard, label = ("scenario", "KEEP-OUT LIFTED") if lifted else ("port", "CORRIDOR AT PORT")
                w.button(console, "docking.keep-out", guard, label=label, fill=style.WARN)
                imgui.same_line()
            with w.ctx.begin_group():
                rates = rates_text(console)
                right = imgui.get_cursor_pos_x() + w.width - imgui.calc_text_size(rates).x
                self._messages(console, w.width, right - imgui.get_cursor_pos_x() - w.line)
            imgui.set_cursor_pos(w.vec(right, low.y + w.line))
            w.one_line(rates, style.QUIET)
            w.tip(f"how often the window and the pictures are drawn a second; window by {console.window_gl}")
        imgui.end()
        imgui.pop_style_color()
        imgui.pop_style_var()

    def _messages(self, console: Console, first: float, second: float) -> None:
        """Draw the newest caution that waits, and below it the newest message; one alone has both lines.

        Parameters
        ----------
        console : Console
            The console.
        first : float
            Width of the first line [px].
        second : float
            Width of the second line [px].
        """
        w = self._w
        texts, tip = message_texts(console), "a click opens the log of all messages"
        # panels are drawn later, and say it again for the next frame
        flaw, w.window.flaw = w.window.flaw, ""
        if flaw != self._flaw[0]:
            self._flaw = flaw, console.messages.said
        # a later message outranks it; the field is framed and says it, too
        if text := _abort_text(console) or (flaw if console.messages.said == self._flaw[1] else ""):
            texts = [*texts[: bool(console.messages.waiting)], (text, style.BAD)]
        if len(texts) == 1:
            text, colour = texts[0]
            n = len(text)
            while n > 1 and w.imgui.calc_text_size(text[:n]).x > first:
                n = text.rfind(" ", 0, n) if " " in text[:n] else n - 1
            texts = [(text[:n], colour), (text[n:].lstrip(), colour)][: 1 + (n < len(text))]
            tip = f"{text}\n{tip}" if n < len(text) else tip
        for (text, colour), room in zip(texts, (first, second), strict=False):
            w.cut_line(text, room, colour, tip, typing=True)
            if w.imgui.is_item_clicked():
                console.do("panel.log", True)

    def _master_caution(self, console: Console) -> None:
        """Draw the light of unacknowledged cautions, which blinks until a click or F9."""
        imgui, w = self._w.window.imgui, self._w
        waiting = console.messages.waiting
        warning = any(m.level == "warning" for m in waiting)
        colour = style.BAD if warning else style.WARN
        bright = bool(waiting) and console.clock_ms % 1000 < 650
        face = (*colour[:3], 0.95) if bright else style.EDGE
        ink = style.GROUND if bright else colour if waiting else style.QUIET
        label = f"{'WARNING' if warning else 'CAUTION'} {len(waiting)}" if waiting else "no cautions"
        with w.ctx.push_style_color(imgui.Col_.button, imgui.ImVec4(*face)), w.coloured(ink):
            if imgui.small_button(f"{label}##master") and waiting:
                console.do("window.acknowledge")
        newest = "\n".join(m.text for m in reversed(waiting[-8:]))
        w.tip(f"{newest}\nclick, or F9: mark as seen" if waiting else "master caution: no unseen messages")


def message_texts(console: Console) -> list[tuple[str, style.Rgba]]:
    """Return the newest caution that waits and the newest other message, with their colours.

    If the caution is newer, a result of a job stays beside it, such as a finished film, otherwise the caution before.
    An answer to the operator outlasts news of the flight for `ANSWER_MS`.
    """
    waiting, notes = console.messages.waiting, [m for m in console.messages if m.level == "note"]
    answer = [m for m in notes if not m.news][-1:]
    fresh = [m for m in answer if not m.acknowledged and console.clock_ms < m.said_ms + ANSWER_MS]
    # an older note does not come back when the newest one ends
    note = [m for m in fresh or notes[-1:] if not m.acknowledged]
    if not waiting + note:
        return [("F1: commands and keys", style.QUIET)]
    last = next(m for m in reversed(console.messages) if m in waiting + note)
    shown = [*waiting[-1:], *([m for m in note if m.of or m is last] or waiting[-2:-1])]
    more = len(waiting) - sum(m in waiting for m in shown)
    # a refusal is no news of the flight, which is dim
    ink = style.INK if waiting or shown[-1].of else style.QUIET
    colours = {"note": ink, "caution": style.WARN, "warning": style.BAD}
    texts = [(" ".join(m.text.split()), colours[m.level]) for m in shown]
    if waiting:
        texts[0] = f"{texts[0][0]} ({f'{more} more; ' * bool(more)}F9: seen)", texts[0][1]
    return texts


def rates_text(console: Console) -> str:
    """Return the frame rates of the window and of each visible view."""
    views = [f"{name.replace('-', ' ')} {f.frames_s:.0f}" for name, f in console.feeds.items() if f.looked_at]
    pictures = f"pictures {console.feed.frames_s:.0f}/s"
    return f"window {console.window_hz:.0f}/s   {', '.join([pictures, *(f'{v}/s' for v in views)])}"


def _abort_text(console: Console) -> str:
    """Return the effect of a second click on ABORT and the time left for it; empty while its guard is closed."""
    left_ms, to_m = console.hand.abort_by_ms - console.clock_ms, console.session.craft.steering.retreat_to_m
    near = console.telemetry.range_m <= to_m
    effect = f"retreats to {to_m:.3g} m from the target" if near else "ends guidance: the chaser drifts"
    return f"ABORT: a second click within {math.ceil(left_ms / 1000)} s {effect}" if left_ms > 0 else ""
