"""The question before quitting while a job runs or something is not saved; nothing else waits for its answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class QuitQuestion(Panel):
    """The jobs that quitting ends, and the flights and texts that it discards."""

    name, title, place, shown = "quit", "Quit?", "over", False
    size = (440.0, 210.0)

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        lost = console.losses
        w.text("If you quit now:" if lost else "Everything is saved.")
        for line in lost:
            w.text(f"- {line}", style.WARN)
        imgui.dummy(w.vec(0, 1))
        if console.session in console.unsaved:
            w.button(console, "timeline.keep", width=-1)
        w.button(console, "window.close", label="Quit", width=w.width / 2 - 4, fill=style.GUARDED)
        imgui.same_line()
        if w.filled_button("Stay", -1, style.PRIMARY):
            console.open_panel(self.name, shown=False)
        w.tip("Esc does the same")
