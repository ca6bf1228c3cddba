"""Searchable list of all commands and their keys."""

from __future__ import annotations

import re
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
    """Commands by group; a click executes one, Enter the typed one with its arguments, or the first match."""

    name, title, place, shown = "keys", "Find a command", "over", False
    keys = ("f1", "h", "ctrl+p")

    _query = ""

    def draw(self, console: Console) -> None:
        """Draw into the current window."""
        w, imgui = self._w, self._w.imgui
        imgui.set_next_item_width(-1)
        if imgui.is_window_appearing():
            self._query = ""
            imgui.set_keyboard_focus_here()
        flags, hint = imgui.InputTextFlags_.enter_returns_true, "a command, for example: time.rate 10"
        entered, self._query = imgui.input_text_with_hint("##find", hint, self._query, flags)
        w.tip("letters of a command's name, help or key; or a command and its arguments, as in a script")
        first, _, rest = self._query.strip().partition(" ")
        # words may be of the help, or the arguments of the first one
        matching = [c for c in console.table if matches(c, self._query)]
        if first in console.table:
            matching = [console.table[first]]
        elif not matching:
            matching = [c for c in console.table if matches(c, first)]
        else:
            rest = ""
        # "light" means lights, not flights
        matching.sort(key=lambda c: not has_word(c, first))
        # the list stays in place while the typed line is seen; the window is as tall as the list
        pad, room = imgui.get_style().window_padding.y, 0.9 * imgui.get_main_viewport().work_size.y
        most = min(self.size[1] * self._window.scale, room) - imgui.get_cursor_pos_y() - pad
        imgui.set_next_window_size_constraints(w.vec(0, 0), w.vec(w.width, most))
        with w.ctx.begin_child("commands", w.vec(w.width, 0), imgui.ChildFlags_.auto_resize_y):
            for group in dict.fromkeys(c.group for c in matching):
                w.section(group.capitalize())
                if command_rows(w, console, [c for c in matching if c.group == group]):
                    console.open_panel(self.name, shown=False)
        if not matching:
            w.text(f"no command has {first!r}", style.QUIET)
        imgui.set_window_size(w.vec(imgui.get_window_width(), imgui.get_cursor_pos_y() + pad))
        if entered and first:
            console.open_panel(self.name, shown=False)
            # the line itself reports an unknown name
            name = next((c.name for c in matching if not c.held), first)
            console.do_line(f"{name} {rest}")


def command_rows(w: Widgets, console: Console, commands: Iterable[Command]) -> bool:
    """Draw a table of commands: key, title and help; a click on a title does the command.

    Returns
    -------
    bool
        True if a command was done.
    """
    done = False

    def title(c: Command) -> None:
        nonlocal done
        if c.at_once and not c.held:
            if w.imgui.selectable(f"{w.elided(c.title, w.width)}##{c.name}", False)[0]:
                console.do(c.name)
                done = True
        else:
            w.text(c.title)
        w.command_tip(console, c.name)

    def row(c: Command) -> tuple[Callable[[], object], ...]:
        about = partial(w.text, f"{c.help}{' (hold)' if c.held else ''}", style.QUIET)
        return partial(w.text, c.shown, style.ACCENT), partial(title, c), about

    w.table("rows", (0.15, 0.3, 0.55), map(row, commands))
    return done


def matches(command: Command, words: str) -> bool:
    """Return True if every word is in the command's name, title, help or keys."""
    text = f"{command.name} {command.title} {command.help} {command.shown}".lower()
    return all(word in text for word in words.lower().split())


def has_word(command: Command, start: str) -> bool:
    """Return True if a word of the command's name or title begins with some letters."""
    words = re.split(r"\W+", f"{command.name} {command.title}".lower())
    return any(word.startswith(start.lower()) for word in words)
