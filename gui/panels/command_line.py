"""The flight and view on the screen as command lines, to be copied."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.picture.command_line import command_lines
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class CommandLinePanel(Panel):
    """Command lines with a button to copy each."""

    name, title, place, shown = "command-line", "As a command line", "bottom", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        command_line = command_lines(console.session, console.options, console.source, console.saved_truth)
        for what, line in command_line.lines:
            w.text(what, style.QUIET)
            w.button(console, "log.copy-text", line, label="Copy")
            imgui.same_line()
            imgui.push_font(w.window.figure_font, 0.0)
            w.text(line)
            imgui.pop_font()
        for text in command_line.left_out:
            w.text(text, style.WARN)
