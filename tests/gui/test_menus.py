"""Menus and the status line of the whole layout, laid out without a window."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.layout import Layout, SavedLayout
from flyaround.gui.menus import MENUS, commands_of
from flyaround.gui.transport import GUARD_MS
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

FAR = (640.0, 500.0)


class Screen:
    """The console's layout, with a pointer and keys."""

    def __init__(self) -> None:
        self.window = HeadlessWindow()
        self.console = console_flying("tango-space-10m")
        self.layout = Layout(self.window, SavedLayout(tour_seen=True))
        self.console.shown.update(dict.fromkeys(self.layout.first_shown(), False))
        self.menus: dict[str, tuple[float, float]] = {}
        self.opened: list[str] = []
        real = self.window.plain.begin_menu

        def begin_menu(label: str) -> bool:
            opened = real(label)
            if opened:
                self.opened.append(label)
            else:
                low, high = self.window.plain.get_item_rect_min(), self.window.plain.get_item_rect_max()
                self.menus[label] = ((low.x + high.x) / 2, (low.y + high.y) / 2)
            return bool(opened)

        self.window.imgui.begin_menu = begin_menu

    def turn(self) -> None:
        imgui = self.window.plain
        imgui.get_io().delta_time = 0.2
        self.opened.clear()
        self.window.noted.clear()
        imgui.new_frame()
        self.layout.draw(self.console)
        imgui.render()

    def click(self, place: tuple[float, float]) -> None:
        io = self.window.plain.get_io()
        io.add_mouse_pos_event(*place)
        self.turn()
        for down in (True, False):
            io.add_mouse_button_event(0, down)
            self.turn()
        self.turn()

    def escape(self) -> None:
        io, escape = self.window.plain.get_io(), self.window.plain.Key.escape
        for down in (True, False):
            io.add_key_event(escape, down)
            self.turn()

    def place(self, label: str) -> tuple[float, float]:
        """The middle of a control."""
        return next(n.middle for n in self.window.noted if n.what == "control" and n.label.startswith(label))

    def texts(self) -> list[str]:
        return [n.label for n in self.window.noted if n.what == "text"]


@pytest.fixture
def screen() -> Iterator[Screen]:
    made = Screen()
    made.turn()
    made.turn()
    yield made
    made.console.close()
    made.window.close()


def test_escape_closes_a_menu_and_the_next_click_opens_it_again(screen: Screen) -> None:
    for _ in range(4):
        screen.click(screen.menus["View"])
        assert "View" in screen.opened
        screen.escape()
        assert not screen.opened
        screen.window.plain.get_io().add_mouse_pos_event(*FAR)
        screen.turn()


def test_the_status_line_shows_the_newest_message(screen: Screen) -> None:
    screen.console.say("the board is gone", "warning")
    screen.console.say("bad.toml is no scenario", "caution")
    screen.turn()
    assert any("bad.toml is no scenario (1 more" in text for text in screen.texts())
    screen.console.say("saved a picture")
    screen.turn()
    assert any("saved a picture (2 more" in text for text in screen.texts())
    screen.console.acknowledge()
    screen.turn()
    assert "saved a picture" in screen.texts()


def test_seven_menus_hold_every_command_once(screen: Screen) -> None:
    offered = [c.name for c in screen.console.table if not c.held and c.at_once]
    held = [
        name
        for _, entries in MENUS
        for _, names in entries
        for entry in names
        for name in commands_of(screen.console.table, entry)
    ]
    assert len(MENUS) == 7
    assert sorted(held) == sorted(offered)


def test_abort_takes_two_clicks_and_its_guard_closes_by_itself(screen: Screen) -> None:
    done: list[str] = []
    screen.console.do = lambda name, *_: done.append(name)  # type: ignore[method-assign]
    assert screen.place("HAND OFF")
    abort = screen.place("ABORT")
    screen.click(abort)
    assert done == []
    screen.console.clock_ms += GUARD_MS
    screen.click(abort)
    assert done == []
    screen.click(abort)
    assert done == ["docking.abort"]


def test_a_panel_fills_the_window_until_escape(screen: Screen) -> None:
    screen.console.do("window.enlarge", "lvlh-map")
    screen.turn()
    x, _, width, _ = screen.console.help.rects["lvlh-map"]
    assert (x, width) == (0.0, screen.window.size[0])
    screen.escape()
    assert screen.console.window.enlarged == ""
    screen.console.do("window.enlarge", "no-such-panel")
    screen.turn()
    assert "there is no panel" in screen.console.messages[-1].text
