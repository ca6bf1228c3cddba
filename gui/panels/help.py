"""What one panel is for, and the commands that belong to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.panels.key_list import matches
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console

GROUPS = {
    "camera": ("overlay", "picture", "film"),
    "chaser": ("steer",),
    "log": ("log",),
    "lvlh-map": ("map",),
    "board-link": ("hil",),
    "scenarios": ("scenario", "file"),
    "editor": ("scenario",),
    "world": ("world",),
    "steering": ("steer", "guide", "burn"),
    "keys": ("help", "window"),
}
"""Groups of the commands of a panel that is not called as they are."""


class HelpPanel(Panel):
    """Opened with ? for the panel under the mouse."""

    name, title, place, shown = "help", "About this panel", "over", False

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        name = console.help.panel or "camera"
        title, text = console.help.about.get(name, (name, "There is no such panel."))
        w.section(title)
        w.text(text)
        opens = f"panel.{name}"
        groups = GROUPS.get(name, (name,))
        commands = [
            c for c in console.table if c.name == opens or c.group in groups or matches(c, f"{name}.")
        ]
        w.section("Commands")
        if not imgui.begin_table("rows", 3, imgui.TableFlags_.sizing_stretch_prop):
            return
        for column, share in (("key", 0.2), ("name", 0.35), ("help", 0.45)):
            imgui.table_setup_column(column, imgui.TableColumnFlags_.width_stretch, share)
        for c in commands:
            imgui.table_next_row()
            for words, colour in ((c.shown, style.ACCENT), (c.name, style.INK), (c.help, style.QUIET)):
                imgui.table_next_column()
                w.text(words, colour)
        imgui.end_table()
