"""The purpose of one panel, and its commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.panels.key_list import command_rows, matches
from flyaround.gui.texts import texts
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console

GROUPS = texts("help")
"""Command groups of panels whose name differs from the group's."""


class HelpPanel(Panel):
    """Description of the panel under the mouse, opened with ?."""

    name, title, place, shown = "help", "About this panel", "over", False

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w = self._w
        name = console.help.panel or "camera"
        title, text = console.help.descriptions.get(name, (name, "There is no such panel."))
        w.section(title)
        w.text(text)
        opens = f"panel.{name}"
        groups = GROUPS.get(name, (name,))
        found = [c for c in console.table if c.name == opens or c.group in groups or matches(c, f"{name}.")]
        w.section("Commands")
        command_rows(w, console, found)
