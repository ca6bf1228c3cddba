"""Questions before something is lost, which nothing else waits for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.views.earth_map import duration_text
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


class FlyOnQuestion(Panel):
    """Asked once when a command would fly on from an earlier time and drop what was flown after it."""

    name, title, place, shown = "fly-on", "Fly on?", "over", False
    size = (440.0, 150.0)

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, session, waits = self._w, console.session, console.asked
        minutes, seconds = divmod(round(session.look_back.timeline.end_s - session.t_s), 60)
        now, flown = duration_text(int(session.t_s)), f"{minutes} min {seconds} s"
        w.text(f"Fly on from T+{now}? The {flown} flown after it are dropped.", style.WARN)
        w.tip("a command that flies on from the past drops the flight after it")
        w.text("Timeline, Swap future brings back the part dropped last.", style.QUIET)
        stays = waits is None or not session.look_back.active
        goes = w.filled_button("Fly on", w.width / 2 - 4, style.GUARDED)
        w.tip("fly on from the time shown, and do what was asked for")
        if goes:
            console.do("timeline.fly-on")
            # a key must be pressed again
            if waits is not None and not waits[0].held:
                console.do(waits[0].name, *waits[1])
            stays = True
        w.imgui.same_line()
        if w.filled_button("Stay here", -1, style.PRIMARY) or stays:
            console.open_panel(self.name, shown=False)
        w.tip("go on looking back; Esc does the same")
