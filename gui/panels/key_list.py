"""Every command with its key, and a line to find one by a few of its letters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.gui.command_table import Command
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


class KeyList(Panel):
    """The commands by group; a click does one."""

    name, title, place, shown = "keys", "Commands and keys", "over", False
    keys = ("f1", "h")

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._wanted = ""

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(-1)
        if imgui.is_window_appearing():
            self._wanted = ""
        _, self._wanted = imgui.input_text_with_hint("##find", "find a command", self._wanted)
        w.tip("a few letters of a command's name, help or key; a click on one does it")
        for group, commands in console.table.groups():
            found = [c for c in commands if matches(c, self._wanted)]
            if found:
                w.section(group.capitalize())
                self._rows(console, found)

    def _rows(self, console: Console, commands: Iterable[Command]) -> None:
        w, imgui = self._w, self._w.imgui
        flags = imgui.TableFlags_.sizing_stretch_prop
        if not imgui.begin_table("rows", 3, flags):
            return
        imgui.table_setup_column("key", imgui.TableColumnFlags_.width_stretch, 0.2)
        imgui.table_setup_column("title", imgui.TableColumnFlags_.width_stretch, 0.3)
        imgui.table_setup_column("help", imgui.TableColumnFlags_.width_stretch, 0.5)
        for c in commands:
            imgui.table_next_row()
            imgui.table_next_column()
            w.text(c.shown, style.ACCENT)
            imgui.table_next_column()
            if c.at_once and not c.held:
                if imgui.selectable(f"{w.elided(c.title, w.width)}##{c.name}", False)[0]:
                    console.do(c.name)
            else:
                w.text(c.title)
            w.about(console, c.name)
            imgui.table_next_column()
            w.text(f"{c.help}{' (hold)' if c.held else ''}", style.QUIET)
        imgui.end_table()


class Palette(Panel):
    """A command by its first letters, and Enter; arguments after it as in a script."""

    name, title, place, shown = "palette", "Do ...", "over", False
    keys = ("ctrl+p",)
    rows = 9

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._line = ""

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        if imgui.is_window_appearing():
            self._line = ""
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self._line = imgui.input_text_with_hint(
            "##line", "a command, for example: time.rate 10", self._line, flags
        )
        w.tip("a command and its arguments, as a script has them; Enter does it, or the first one below")
        name, _, rest = self._line.strip().partition(" ")
        found = [c for c in console.table if not c.held and matches(c, name)][: self.rows]
        chosen = None
        for c in found:
            if imgui.selectable(w.elided(f"{c.form}   {c.help}", w.width), False)[0]:
                chosen = c.name
            w.about(console, c.name)
        if entered and name:
            # a name that nobody knows is told by whoever does the line
            chosen = name if name in console.table or not found else found[0].name
        if chosen is not None:
            console.open_panel(self.name, shown=False)
            console.do_line(f"{chosen} {rest}")


def matches(command: Command, wanted: str) -> bool:
    """Whether every word of what is looked for is in the command's name, title, help or keys."""
    text = f"{command.name} {command.title} {command.help} {command.shown}".lower()
    return all(word in text for word in wanted.lower().split())
