"""Panel of the chaser: manual steering or guidance, and its figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.picture.figures import FIGURES
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console

SHOWN = ("Position [m]", "Velocity [m/s]", "Target [°/s]", "Camera [°/s]", "Off boresight")
"""Figures of this panel; the others are drawn over the view."""
BUTTONS = ("steer.toggle", "steer.reset", "steer.stop", "guidance.hold", "steer.track", "steer.centre")
HEADS = {
    "Position [m]": ("Target's LVLH", ("radial", "along", "cross")),
    "Target [°/s]": ("Camera axes", ("x right", "y down", "z ahead")),
}
"""Frame and names of the components from a figure on."""


class ChaserPanel(Panel):
    """Guidance or steering by hand; position, speeds and rates of the time that is shown."""

    name, title, place, shown = "chaser", "Chaser", "right-upper", True

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w = self._w
        w.buttons(console, BUTTONS, 3)
        for k, (name, figure) in enumerate(FIGURES.items()):
            if name in HEADS:
                with w.coloured(style.QUIET):
                    w.row(*HEADS[name], "{:>8}", figure.tip)
            if name in SHOWN:
                w.row(name, figure.values(console.telemetry), figure.form, figure.tip, figure=k)
