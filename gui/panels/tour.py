"""Panel of the tour: six tasks, each ticked when done. Shown at the first start, and by Help, Tour."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flyaround.gui import style
from flyaround.gui.texts import texts
from flyaround.gui.usable import is_usable
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.cautions import AT_REST_M_S

if TYPE_CHECKING:
    from flyaround.gui.console import Console

LABELS = {"help.tour-back": "Back", "help.tour-next": "Skip this", "help.tour-end": None}
"""Labels of the tour's buttons, where they are shorter than their commands' titles."""
MOST_LINES = 200
"""Number of recent log entries in which a step's command is searched."""


class TourStep(NamedTuple):
    """A step of the tour.

    Parameters
    ----------
    title : str
        Name of the step.
    text : str
        What to do.
    commands : frozenset of str
        Commands of which one completes the step.
    place : str
        Panel or bar that holds the last of the controls.
    controls : tuple of str
        Commands of the controls that are framed in turn; the first of two opens the panel.
    """

    title: str
    text: str
    commands: frozenset[str]
    place: str
    controls: tuple[str, ...]

    @property
    def at_once(self) -> bool:
        """True if its panel opens with the step."""
        return len(self.controls) == 1 and self.place != "transport"

    def control(self, console: Console) -> str:
        """Return the command of the control to frame: the last, unless another one must open its panel first."""
        in_sight = console.shown.get(self.place) and self.place not in console.help.behind
        return self.controls[-1 if in_sight else 0]


STEPS = tuple(
    TourStep(title, text, frozenset(commands.split()), place, tuple(controls.split()))
    for title, text, place, controls, commands in texts("tour").values()
)
FLY, REST = (STEPS[list(texts("tour")).index(name)] for name in ("fly", "rest"))


class TourPanel(Panel):
    """List of tasks; the next one is described, and its control is framed."""

    name, title, place, shown = "tour", "Tour", "bottom", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        done_by = {line.name for line in console.log.lines[-MOST_LINES:]}
        posed = any(e.E_R_deg is not None for e in console.jobs.estimates.history)
        done_by -= set() if posed else {"estimator.run"}
        # a key that is pressed while time stands flies nothing
        done_by -= set() if console.hand.flown else FLY.commands
        # braking takes its time
        rests = np.linalg.norm(console.telemetry.velocity_lvlh_m_s) < AT_REST_M_S
        done_by -= set() if rests else REST.commands
        step = console.help.tour_step
        if step < len(STEPS) and STEPS[step].commands & done_by:
            console.help.tour_step = step = step + 1
        for k, tour_step in enumerate(STEPS):
            title = f"{k + 1}  {tour_step.title}{', done' if k < step else ''}   "
            w.flow(imgui.calc_text_size(title).x, first=k == 0)
            w.one_line(title, style.GOOD if k < step else style.ACCENT if k == step else style.QUIET)
        if step < len(STEPS):
            w.text(f"{STEPS[step].text} The blue frame shows where.")
        else:
            w.text("F1 lists every command and key; ? tells about the panel under the mouse.")
        for name, label in LABELS.items():
            if is_usable(console, name):
                w.button(console, name, label=label)
                imgui.same_line()
