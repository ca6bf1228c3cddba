"""The menu bar: seven menus that hold every command that needs no argument, each once."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import cache
from typing import TYPE_CHECKING

from flyaround.gui.widgets import Widgets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.gui.command_table import CommandTable
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface

Entries = tuple["str | tuple[str, Entries]", ...]
"""Names of commands, which may end in ``*`` for those that no other entry has; or a title and its own entries."""

MENUS: tuple[tuple[str, Entries], ...] = (
    (
        "File",
        (
            "panel.scenarios",
            ("Scenario text", ("panel.editor", "scenario.*")),
            ("Export", ("picture.save", "film.*", "window.screenshot", "log.*", "panel.command-line")),
            ("Keep the flight", ("timeline.keep", "timeline.dataset", "timeline.hil")),
            "settings.*",
            "window.close",
        ),
    ),
    (
        "Flight",
        (
            "time.pause",
            "time.step",
            "time.restart",
            "time.faster",
            "time.slower",
            ("Jump to", ("time.next-*",)),
            ("Timeline", ("panel.timeline", "timeline.*")),
        ),
    ),
    (
        "Vehicle",
        (
            "steer.arm",
            "steer.toggle",
            "steer.stop",
            ("Attitude and axes", ("steer.*",)),
            ("Guidance", ("guidance.*",)),
            ("Burns", ("burn.*",)),
            ("Docking", ("panel.docking", "docking.*")),
            "docking.abort",
            "panel.chaser",
            "panel.steering",
        ),
    ),
    (
        "Camera",
        (
            "picture.meter",
            "picture.colour",
            "picture.noise",
            "sensor.reset",
            ("World", ("panel.world", "world.*")),
            "panel.picture",
            "panel.sensor",
            "panel.target",
        ),
    ),
    (
        "View",
        (
            ("Overlays", ("overlay.*",)),
            ("Maps", ("panel.lvlh-map", "map.*", "panel.earth-map", "panel.orbit-camera", "orbit-camera.*")),
            ("Label images", ("panel.depth", "panel.parts", "panel.keypoints")),
            "panel.camera",
            "window.panels",
            "window.enlarge",
            ("Layout", ("layout.*",)),
            "window.full-screen",
            "window.larger-text",
            "window.smaller-text",
        ),
    ),
    (
        "Tools",
        (
            ("Estimator", ("panel.estimator", "estimator.*")),
            ("Hardware in the loop", ("panel.board-link", "hil.*")),
            ("Capture", ("panel.capture", "capture.*")),
            "panel.plots",
            "panel.passes",
        ),
    ),
    (
        "Help",
        (
            "panel.keys",
            "panel.palette",
            "help.panel",
            ("Tour", ("panel.tour", "help.*")),
            "panel.help",
            "panel.log",
            "window.acknowledge",
        ),
    ),
)


def named(entries: Entries) -> Iterator[str]:
    """Names in these entries and in those of their submenus."""
    for entry in entries:
        if isinstance(entry, str):
            yield entry
        else:
            yield from named(entry[1])


EXPLICIT = frozenset(name for _, entries in MENUS for name in named(entries) if "*" not in name)


@cache
def commands_of(table: CommandTable, entry: str) -> tuple[str, ...]:
    """Names of the commands that an entry stands for, in the table's order."""
    offered = (c.name for c in table if not c.held and c.at_once)
    if "*" not in entry:
        return (entry,)
    return tuple(name for name in offered if fnmatchcase(name, entry) and name not in EXPLICIT)


class MenuBar:
    """The menu bar of one window.

    Parameters
    ----------
    window : drawn in.
    """

    def __init__(self, window: Surface) -> None:
        self._imgui, self._w = window.imgui, Widgets(window)

    def draw(self, console: Console) -> None:
        """Draw the menus into the current main menu bar."""
        for title, entries in MENUS:
            self._menu(console, title, entries)

    def _menu(self, console: Console, title: str, entries: Entries) -> None:
        if not self._imgui.begin_menu(title):
            return
        for entry in entries:
            if not isinstance(entry, str):
                self._menu(console, *entry)
                continue
            for name in commands_of(console.table, entry):
                command = console.table[name]
                on = command.state is not None and command.state(console)
                if self._imgui.menu_item_simple(command.title, command.shown, on):
                    console.do(name)
                self._w.about(console, name)
        self._imgui.end_menu()
