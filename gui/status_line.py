"""The line at the bottom of the window: master caution, newest message, rates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Widgets

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


LEAST = 40.0  # width below which a message is not worth reading


class StatusLine:
    """The status line of one window.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._w = Widgets(window)

    def draw(self, console: Console) -> None:
        """Draw into the current frame."""
        imgui, w = self._w.window.imgui, self._w
        kinds = imgui.WindowFlags_
        flags = kinds.no_scrollbar | kinds.no_saved_settings | kinds.menu_bar
        height = imgui.get_frame_height()
        if (
            imgui.internal.begin_viewport_side_bar(
                "status", imgui.get_main_viewport(), imgui.Dir.down, height, flags
            )
            and imgui.begin_menu_bar()
        ):
            self._master_caution(console)
            if console.options.guard == "lifted":
                w.button(console, "docking.keep-out", "scenario", label="KEEP-OUT LIFTED", fill=style.WARN)
            rates = rates_text(console)
            free = w.width - imgui.calc_text_size(rates).x - 44 * self._w.window.scale
            self._messages(console, free)
            imgui.same_line(
                imgui.get_window_width() - imgui.calc_text_size(rates).x - 28 * self._w.window.scale
            )
            w.one_line(rates, style.QUIET)
            w.tip(f"how often the window and the pictures are drawn a second; window by {console.window_gl}")
            imgui.end_menu_bar()
        imgui.end()

    def _messages(self, console: Console, free: float) -> None:
        """Draw the newest caution that waits, and after it the newest message, each of which has half of the line."""
        w = self._w
        texts = message_texts(console)
        # panels are drawn later, and say it again for the next frame
        if flaw := w.window.flaw:
            texts, w.window.flaw = [(flaw, style.BAD)], ""
        gap = 16 * w.window.scale
        wide = [w.imgui.calc_text_size(text).x for text, _ in texts]
        for k, (text, colour) in enumerate(texts):
            others = sum(wide) - wide[k] + gap * (len(texts) - 1)
            room = max(free - others, free / len(texts) - gap)
            if room < LEAST:
                return
            if k:
                w.imgui.same_line(0, gap)
            w.cut_line(text, room, colour, "a click opens the log of all messages", typing=True)
            if w.imgui.is_item_clicked():
                console.do("panel.log", True)

    def _master_caution(self, console: Console) -> None:
        """Draw the light of unacknowledged cautions, which blinks until a click or F9."""
        imgui, w = self._w.window.imgui, self._w
        waiting = console.waiting
        warning = any(m.level == "warning" for m in waiting)
        colour = style.BAD if warning else style.WARN
        bright = bool(waiting) and console.clock_ms % 1000 < 650
        face = (*colour[:3], 0.95) if bright else style.EDGE
        ink = style.GROUND if bright else colour if waiting else style.QUIET
        label = f"{'WARNING' if warning else 'CAUTION'} {len(waiting)}" if waiting else "no cautions"
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*face))
        w.coloured(ink)
        if imgui.small_button(f"{label}##master") and waiting:
            console.do("window.acknowledge")
        imgui.pop_style_color(2)
        newest = "\n".join(m.text for m in reversed(waiting[-8:]))
        w.tip(f"{newest}\nclick, or F9: mark as seen" if waiting else "master caution: no unseen messages")


def message_texts(console: Console) -> list[tuple[str, style.Rgba]]:
    """Return the newest caution that waits and the newest other message, or the caution before; with their colours."""
    current = [m for m in console.messages if not m.acknowledged]
    if not current:
        return [("F1: commands and keys", style.QUIET)]
    waiting, newest = console.waiting, current[-1]
    shown = [*waiting[-1:], newest] if newest not in waiting else waiting[:-3:-1]
    more = len(waiting) - sum(m in waiting for m in shown)
    colours = {"note": style.INK if waiting else style.QUIET, "caution": style.WARN, "warning": style.BAD}
    texts = [(" ".join(m.text.split()), colours[m.level]) for m in shown]
    if waiting:
        texts[0] = f"{texts[0][0]} ({f'{more} more; ' * bool(more)}F9: seen)", texts[0][1]
    return texts


def rates_text(console: Console) -> str:
    """Return the frame rates of the window and of each visible view."""
    views = [f"{name.replace('-', ' ')} {f.frames_s:.0f}" for name, f in console.feeds.items() if f.looked_at]
    pictures = f"pictures {console.feed.frames_s:.0f}/s"
    return f"window {console.window_hz:.0f}/s   {', '.join([pictures, *(f'{v}/s' for v in views)])}"
