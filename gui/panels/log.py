"""What the console said, and what was done, as a script that does it again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console

SHOWN_LINES = 200
COLOURS = {"note": style.QUIET, "caution": style.WARN, "warning": style.BAD}


class LogPanel(Panel):
    """Messages, and the commands as a script."""

    name, title, place, shown = "log", "Log", "bottom", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        if not imgui.begin_tab_bar("log"):
            return
        if imgui.begin_tab_item_simple("Messages"):
            for message in reversed(console.messages[-SHOWN_LINES:]):
                colour = style.QUIET if message.acknowledged else COLOURS[message.level]
                w.text(f"{message.t_ms / 1000:9.1f} s  {message.text}", colour)
            imgui.end_tab_item()
        if imgui.begin_tab_item_simple("Cautions"):
            w.button(console, "window.acknowledge")
            raised = [m for m in console.messages if m.level != "note"]
            if not raised:
                w.text("none so far", style.QUIET)
            for message in reversed(raised[-SHOWN_LINES:]):
                seen = message.acknowledged_ms
                when = f"seen {seen / 1000:.1f} s" if seen is not None else "not seen yet"
                w.text(
                    f"{message.t_ms / 1000:9.1f} s  {message.level}, {when}: {message.text}",
                    style.QUIET if message.acknowledged else COLOURS[message.level],
                )
            imgui.end_tab_item()
        if imgui.begin_tab_item_simple("Commands"):
            w.button(console, "log.save")
            imgui.same_line()
            w.button(console, "log.copy")
            for line in reversed(console.log.lines[-SHOWN_LINES:]):
                w.text(str(line))
            imgui.end_tab_item()
        imgui.end_tab_bar()
