"""An operator with a pointer at the console's whole layout, laid out without a window; clicks are counted."""

from __future__ import annotations

import numpy as np

from flyaround.gui.console import Console
from flyaround.gui.layout import Layout, SavedLayout
from flyaround.gui.style import Rgba
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow, Noted
from tests.harness.legibility import VERTEX, array_of

NEAR = 4.0
"""Distance of a frame's corner from that of what it frames [px]."""
FAR = (640.0, 500.0)
"""A place without menus."""
STRIPS, STRIP = 90.0, ("ABORT", "ABORT? again", "HAND: OFF", "Pause", "Play")
"""Height of the strips at the bottom of the window, and their controls."""


class Pointer:
    """The console's layout, with a pointer and keys.

    Parameters
    ----------
    scenario : name of the flown one.
    size : size of the window.
    panels : False closes all of them.
    opened : panels opened at the start.
    """

    def __init__(
        self,
        scenario: str = "tango-space-10m",
        size: tuple[int, int] = (1280, 800),
        *,
        panels: bool = True,
        opened: tuple[str, ...] = (),
    ) -> None:
        self.window = HeadlessWindow(size)
        self.window.plain.get_io().config_flags |= self.window.plain.ConfigFlags_.docking_enable
        self.console: Console = console_flying(scenario)
        self.layout = Layout(self.window, SavedLayout())
        shown = self.layout.first_shown()
        self.console.shown.update(shown if panels else dict.fromkeys(shown, False))
        self.console.help.descriptions = self.layout.descriptions()
        for name in opened:
            self.console.open_panel(name, shown=True)
        self.menus: dict[str, tuple[float, float]] = {}
        self.opened: list[str] = []
        self.clicks = 0
        real = self.window.plain.begin_menu

        def begin_menu(label: str) -> bool:
            opened = real(label)
            label = label.strip()
            if opened:
                self.opened.append(label)
            else:
                low, high = self.window.plain.get_item_rect_min(), self.window.plain.get_item_rect_max()
                self.menus[label] = ((low.x + high.x) / 2, (low.y + high.y) / 2)
            return bool(opened)

        self.window.imgui.begin_menu = begin_menu
        for _ in range(14):
            self.turn()

    def turn(self) -> None:
        """Lay out one frame."""
        imgui = self.window.plain
        imgui.get_io().delta_time = 0.2
        self.opened.clear()
        self.window.noted.clear()
        self.layout.before_frame(self.console, self.window.size)
        imgui.new_frame()
        self.layout.draw(self.console)
        imgui.render()

    def move(self, place: tuple[float, float]) -> None:
        """Move the pointer."""
        self.window.plain.get_io().add_mouse_pos_event(*place)
        self.turn()

    def click(self, place: tuple[float, float], button: int = 0) -> None:
        """Click at a place."""
        self.clicks += 1
        self.move(place)
        for down in (True, False):
            self.window.plain.get_io().add_mouse_button_event(button, down)
            self.turn()
        self.turn()

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag from one place to another."""
        self.clicks += 1
        io = self.window.plain.get_io()
        self.move(begin)
        io.add_mouse_button_event(0, True)
        self.turn()
        for share in (0.3, 0.7, 1.0):
            self.move((begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1])))
        io.add_mouse_button_event(0, False)
        self.turn()

    def press(self, label: str, nth: int = 0) -> None:
        """Click the control with this label, which is scrolled into sight."""
        self.click(self.sight(label, nth))

    def sight(self, label: str, nth: int = 0) -> tuple[float, float]:
        """Return the middle of a control; turn the wheel until it is in sight."""
        low = self.window.size[1] - STRIPS
        for _ in range(40):
            x, y = self.place(label, nth)
            if y < low or label in STRIP:
                break
            self.move((x, low - 40.0))
            self.window.plain.get_io().add_mouse_wheel_event(0.0, -2.0)
            self.turn()
            self.turn()
        return x, y

    def menu(self, *path: str) -> None:
        """Choose an entry of the menus; submenus open under the pointer."""
        self.click(self.menus[path[0]])
        for title in path[1:-1]:
            self.move(self.menus[title])
            for _ in range(3):
                self.turn()
        self.press(path[-1])
        self.move(FAR)
        for _ in range(14):
            self.turn()

    def type(self, place: tuple[float, float], text: str) -> None:
        """Click into a field, replace its text and press Enter."""
        io, key = self.window.plain.get_io(), self.window.plain.Key
        self.click(place)
        io.add_key_event(key.mod_ctrl, True)
        io.add_key_event(key.a, True)
        self.turn()
        io.add_key_event(key.a, False)
        io.add_key_event(key.mod_ctrl, False)
        self.turn()
        io.add_input_characters_utf8(text)
        self.turn()
        for down in (True, False):
            io.add_key_event(key.enter, down)
            self.turn()

    def escape(self) -> None:
        """Press Escape."""
        io, escape = self.window.plain.get_io(), self.window.plain.Key.escape
        for down in (True, False):
            io.add_key_event(escape, down)
            self.turn()

    def rect(self, name: str) -> tuple[float, float, float, float]:
        """Return left, top, width and height of a panel, or of a strip."""
        find = self.window.plain.internal.find_window_by_name
        native = find(name) or find(f"###{name}")
        return native.pos.x, native.pos.y, native.size.x, native.size.y

    def framed(self, rgba: Rgba, rect: tuple[float, ...] | None = None) -> dict[str, float]:
        """Return windows, from the back, with this colour at a rectangle's corners, or anywhere, and its opacity."""
        rgb = sum(round(255 * c) << 8 * k for k, c in enumerate(rgba[:3]))
        x, y, wide, tall = rect or (0.0, 0.0, 0.0, 0.0)
        corners = [(x, y), (x + wide, y), (x, y + tall), (x + wide, y + tall)] if rect else []
        found = {}
        for part in self.window.plain.get_draw_data().cmd_lists:
            vertices = array_of(part.vtx_buffer, VERTEX)
            vertices = vertices[(vertices["colour"] & 0xFFFFFF) == rgb]
            if len(vertices) and all(np.abs(vertices["at"] - c).max(axis=1).min() < NEAR for c in corners):
                found[part._owner_name] = float((vertices["colour"] >> 24).max()) / 255
        return found

    def place(self, label: str, nth: int = 0) -> tuple[float, float]:
        """Return the middle of a control."""
        return self._controls(label)[nth].middle

    def has(self, label: str) -> bool:
        """Return True if there is a control with this label."""
        return bool(self._controls(label))

    def _controls(self, label: str) -> list[Noted]:
        return [n for n in self.window.noted if n.what == "control" and n.label.startswith(label)]

    def texts(self) -> list[str]:
        """Return every text of the last frame."""
        return [n.label for n in self.window.noted if n.what == "text"]

    def close(self) -> None:
        """End the console."""
        self.console.close()
        self.window.close()
