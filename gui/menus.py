"""The menu bar: seven menus with every command that needs no argument, each once, and some that open their panel."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.icons import ICONS, labelled
from flyaround.gui.texts import texts
from flyaround.gui.usable import is_usable
from flyaround.gui.widgets import Widgets

if TYPE_CHECKING:
    from flyaround.gui.command_table import CommandTable
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface

Entries = tuple[tuple[str, tuple[str, ...]], ...]
"""Titles of submenus with names of commands, which may end in ``*`` for all commands that no other entry lists; entries
of the menu itself have an empty title.
"""
NO_ICON = " " * 7
"""Width of an icon, for aligning titles."""
RECENT = "Recent"  # title of the submenu of scenarios flown last
LEAST_NAME_EM = 6  # least width for the name of the scenario, in text heights
LONGEST_EM = 22  # width of an entry, in text heights
MENUS: tuple[tuple[str, Entries], ...] = tuple(
    (menu, tuple((title, tuple(names.split())) for title, _, names in (e.rpartition(":") for e in entries)))
    for menu, entries in texts("menus").items()
)
PANEL_OF = {group: panel for panel, groups in texts("help").items() for group in groups}
"""Panels by the groups of their commands, where the names differ."""
EXPLICIT = frozenset(
    name for _, entries in MENUS for _, names in entries for name in names if "*" not in name
)


@cache
def commands_of(table: CommandTable, entry: str) -> tuple[str, ...]:
    """Return the names of the commands that an entry matches, in the table's order."""
    if "*" not in entry:
        return (entry,)
    offered = (c.name for c in table if not c.held and c.at_once)
    return tuple(name for name in offered if fnmatchcase(name, entry) and name not in EXPLICIT)


class MenuBar:
    """The menu bar of one window.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._imgui, self._w = window.imgui, Widgets(window)
        self._clicked = ""
        """Menu that the last click opened."""

    def draw(self, console: Console) -> None:
        """Draw the menus into the current main menu bar."""
        for menu, entries in MENUS:
            opened = self._imgui.begin_menu(menu)
            if self._clicks(menu, opened=opened):
                self._imgui.open_popup(menu)
            if not opened:
                continue
            for title, names in entries:
                if title and not self._imgui.begin_menu(f"{NO_ICON}{title}"):
                    continue
                if title == RECENT:
                    self._recent(console)
                for name in (n for entry in names for n in commands_of(console.table, entry)):
                    self._item(console, name)
                if title:
                    self._imgui.end_menu()
            self._imgui.end_menu()
        self._layouts(console)

    def _recent(self, console: Console) -> None:
        """Draw an entry for each scenario flown last, the newest first."""
        for source in console.recent:
            short = "/".join(Path(source).parts[-2:])
            title = self._w.elided(short, LONGEST_EM * self._imgui.get_font_size())
            if self._imgui.menu_item_simple(f"{NO_ICON}{title}###{source}", "", source == console.source):
                console.do("scenario.open", source)
            self._w.command_tip(console, "scenario.open", source)

    def _clicks(self, menu: str, *, opened: bool) -> bool:
        """Return True if a click on a title must open its menu.

        While a menu is open, the pointer opens the next one before it clicks, and Dear ImGui would close that.
        """
        imgui = self._imgui
        if not imgui.is_mouse_clicked(imgui.MouseButton_.left):
            return False
        if opened:
            self._clicked = self._clicked if imgui.is_window_hovered() else menu
            return False
        if not imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_blocked_by_popup):
            return False
        again, self._clicked = menu == self._clicked, menu
        return not again

    def _layouts(self, console: Console) -> None:
        """Draw the search for commands and the layouts at the right end, as far as there is room."""
        layouts = [name for name in commands_of(console.table, "layout.*") if name != "layout.first"]
        names, gap = ["panel.keys", *layouts], self._imgui.get_style().item_spacing.x
        titles = [labelled(name, console.table[name].title) for name in names]
        widths = [self._w.button_width(title) + gap for title in titles]
        while sum(widths) > self._w.width:
            del names[0], widths[0]
        scenario = console.session.plan.scenario
        free = self._w.width - sum(widths) - 4 * gap
        if free > LEAST_NAME_EM * self._imgui.get_font_size():
            self._imgui.set_cursor_pos_x(self._imgui.get_cursor_pos_x() + 2 * gap)
            self._w.cut_line(scenario.name, free, style.QUIET, scenario.title or "the scenario that is flown")
        self._imgui.set_cursor_pos_x(self._imgui.get_window_width() - sum(widths))
        for name in names:
            self._w.button(console, name, on=console.window.layout == name.partition(".")[2])

    def _item(self, console: Console, name: str) -> None:
        command = console.table[name]
        on = command.state is not None and command.state(console)
        step = console.history.next(name)
        title = f"{command.title} {'' if command.at_once else '...'}{step or ''}".rstrip()
        title = self._w.elided(title, LONGEST_EM * self._imgui.get_font_size())
        label = labelled(name, title) if name in ICONS else f"{NO_ICON}{title}"
        usable = step != "" and is_usable(console, name)
        if self._imgui.menu_item_simple(f"{label}###{name}", command.shown, on, usable):
            panel = PANEL_OF.get(command.group, command.group)
            console.do(name) if command.at_once else console.open_panel(panel, shown=True)
        self._w.command_tip(console, name)
