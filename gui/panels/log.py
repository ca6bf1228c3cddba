"""Panel of the console's messages, and of the executed commands as a script that repeats them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.messages import Message

SHOWN_LINES = 200  # newest messages and commands in the panel
COLOURS = {"note": style.QUIET, "caution": style.WARN, "warning": style.BAD}


class LogPanel(Panel):
    """Messages, and the executed commands as a script."""

    name, title, place, shown = "log", "Log", "bottom", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        if not imgui.begin_tab_bar("log"):
            return
        raised = [m for m in console.messages if m.level != "note"]
        for title, messages in (("Messages", console.messages), ("Cautions", raised)):
            if imgui.begin_tab_item_simple(title):
                w.button(console, "window.acknowledge")
                w.text("T+ is the time of the flight, after it the time of day", style.QUIET)
                for message in reversed(messages[-SHOWN_LINES:]):
                    self._message(message)
                imgui.end_tab_item()
        if imgui.begin_tab_item_simple("Commands"):
            w.button(console, "log.save")
            w.text("seconds since the console was opened, as in a script", style.QUIET)
            for line in reversed(console.log.lines[-SHOWN_LINES:]):
                w.text(str(line))
            imgui.end_tab_item()
        imgui.end_tab_bar()

    def _message(self, message: Message) -> None:
        """Write a message; for a caution, also the time of day until which it waited."""
        until = f" until {message.until}" if message.until else ""
        level = "" if message.level == "note" else f"{message.level}{until}: "
        colour = style.QUIET if message.acknowledged else COLOURS[message.level]
        self._w.one_line(f"{mission_time(message.t_s)}  {message.at}", colour)
        self._imgui.same_line(10.5 * self._imgui.get_font_size())
        self._w.text(f"{level}{message.text}", colour)
