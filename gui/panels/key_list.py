"""Every command with its key, and a line to find one by a few of its letters."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.gui.command_table import Command
    from flyaround.gui.console import Console
    from flyaround.gui.widgets import Widgets


class KeyList(Panel):
    """The commands by group; a click does one."""

    name, title, place, shown = "keys", "Commands and keys", "over", False
    keys = ("f1", "h")

    _query = ""

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(-1)
        if imgui.is_window_appearing():
            self._query = ""
        _, self._query = imgui.input_text_with_hint("##find", "find a command", self._query)
        w.tip("a few letters of a command's name, help or key; a click on one does it")
        for group, commands in console.table.groups():
            matching = [c for c in commands if matches(c, self._query)]
            if matching:
                w.section(group.capitalize())
                command_rows(w, console, matching)
        if not any(matches(c, self._query) for c in console.table):
            w.text(f"no command has {self._query!r}", style.QUIET)


def command_rows(w: Widgets, console: Console, commands: Iterable[Command]) -> None:
    """Draw a table of commands: key, title and help; a click on a title does the command."""

    def title(c: Command) -> None:
        if c.at_once and not c.held:
            if w.imgui.selectable(f"{w.elided(c.title, w.width)}##{c.name}", False)[0]:
                console.do(c.name)
        else:
            w.text(c.title)
        w.command_tip(console, c.name)

    def row(c: Command) -> tuple[Callable[[], object], ...]:
        about = partial(w.text, f"{c.help}{' (hold)' if c.held else ''}", style.QUIET)
        return partial(w.text, c.shown, style.ACCENT), partial(title, c), about

    w.table("rows", (0.15, 0.3, 0.55), map(row, commands))


class Palette(Panel):
    """A command by its first letters, and Enter; arguments after it as in a script."""

    name, title, place, shown = "palette", "Find a command", "over", False
    keys = ("ctrl+p",)
    rows = 9

    _line = ""

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
        matching = [c for c in console.table if not c.held and matches(c, name)][: self.rows]
        if not matching:
            w.text(f"no command has {name!r}", style.QUIET)
        command_name = None
        for c in matching:
            if imgui.selectable(w.elided(f"{c.form}   {c.help}", w.width), False)[0]:
                command_name = c.name
            w.command_tip(console, c.name)
        if entered and name:
            # the line itself reports an unknown name
            command_name = name if name in console.table or not matching else matching[0].name
        if command_name is not None:
            console.open_panel(self.name, shown=False)
            console.do_line(f"{command_name} {rest}")


def matches(command: Command, words: str) -> bool:
    """Return True if every word is in the command's name, title, help or keys."""
    text = f"{command.name} {command.title} {command.help} {command.shown}".lower()
    return all(word in text for word in words.lower().split())
