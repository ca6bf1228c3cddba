"""The clock: pause, one frame, restart, rates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.clock import RATES

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class TimePanel(Panel):
    """Pause, step, restart, and how fast time runs."""

    name, title, place, shown = "time", "Time", "right", True

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, session = self._w, console.session
        scenario = session.plan.scenario
        w.text(scenario.title or scenario.name, tip=f"the scenario that is flown: {scenario.name}")
        w.buttons(console, ("time.pause", "time.step", "time.restart"), 3)
        for k, rate in enumerate(RATES):
            label = f"{rate:g}x"
            width = w.imgui.calc_text_size(label).x + 2 * w.imgui.get_style().frame_padding.x
            w.flow(width, first=k == 0)
            w.button(console, "time.rate", f"{rate:g}", label=label, on=rate == session.clock.rate)
