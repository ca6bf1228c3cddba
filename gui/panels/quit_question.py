"""Questions before flights, texts or jobs are lost; they do not block the console."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class QuitQuestion(Panel):
    """Question before quitting, with the jobs that it ends and the flights and texts that it discards."""

    name, title, place, shown = "quit", "Quit?", "over", False
    size, modal = (470.0, 230.0), True

    _keeps = False
    """True while flights are written before the console closes."""

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        lost = console.losses
        # the rows of buttons stay where they are when a job ends
        with w.ctx.begin_child("lost", w.vec(0, -2 * imgui.get_frame_height_with_spacing())):
            w.text("Time stands still. If you quit now:" if lost else "Nothing is lost.")
            for line in lost:
                w.text(f"- {line}", style.WARN, "lost for good if you quit")
        low = imgui.get_cursor_pos_y() + imgui.get_frame_height_with_spacing()
        if self._keeps and not console.jobs.keeping:
            # a flight that could not be written, and a changed text, need an answer
            self._keeps = False
            if not console.flights.unsaved and not console.draft.changed:
                console.do("window.close")
        asks = bool(console.flights.unsaved)
        if asks:
            if w.filled_button("Keep flights and quit", w.width / 2 - 4, style.PRIMARY):
                console.do("timeline.keep-all")
                self._keeps = True
            w.tip("write each flight, without a dropped future, then quit")
            imgui.same_line()
            w.button(console, "timeline.keep-all", width=-1)
        imgui.set_cursor_pos_y(low)
        w.button(console, "window.close", label="Quit", width=w.width / 2 - 4, fill=style.GUARDED)
        imgui.same_line()
        if w.filled_button("Stay", -1, None if asks else style.PRIMARY):
            console.open_panel(self.name, shown=False)
        w.tip("Esc does the same")


class Question(Panel):
    """Question before a command drops a flight, or leaves one that is not kept."""

    name, title, place, shown = "question", "Before you go on", "over", False
    size, modal = (470.0, 170.0), True

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, asked = self._w, console.asked
        if asked is None:
            console.open_panel(self.name, shown=False)
            return
        w.text(asked.text, style.WARN, "flights and texts that the command would discard or leave")
        w.text(f"{asked.way_back} Time stands still.", style.QUIET)
        w.imgui.dummy(w.vec(0, 1))
        keeps = asked.keeps and w.filled_button("Keep the flight and go", -1, style.PRIMARY)
        half = w.width / 2 - 4
        goes = w.filled_button(w.elided(asked.answer, half - 16), half, style.GUARDED)
        w.tip(f"carry out the command: {asked.command.title}")
        w.imgui.same_line()
        stays = w.filled_button("Stay here", -1, None if asked.keeps else style.PRIMARY)
        w.tip("change nothing; Esc does the same")
        if keeps:
            console.do("timeline.keep")
        if goes or stays or keeps:
            console.answer(goes or keeps)
