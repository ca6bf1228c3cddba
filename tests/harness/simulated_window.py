"""A window of a given frame rate in simulated time: keys go down and up at their times, X repeats the one held last."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from flyaround.gui.keyboard import Keyboard
from flyaround.gui.surface import import_parts
from tests.harness.headless_imgui import HeadlessWindow

REPEAT_DELAY_S, REPEAT_EVERY_S = 0.25, 0.04


@dataclass(order=True)
class _Event:
    t_s: float
    order: int
    key: str = field(compare=False)
    action: int = field(compare=False)
    ctrl: bool = field(compare=False, default=False)


class _GlfwState:
    """Constants of glfw, and the state of keys as its events gave it."""

    def __init__(self, glfw: Any) -> None:
        self._glfw = glfw
        self.down: set[int] = set()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._glfw, name)

    def get_key(self, _native: object, key: int) -> int:
        return int(self._glfw.PRESS if key in self.down else self._glfw.RELEASE)


class SimulatedWindow(HeadlessWindow):
    """What the console's loop needs of a window; drawing it takes ``1 / hz`` seconds.

    Parameters
    ----------
    hz : frames per second.
    duration_s : time at which it is closed.
    """

    def __init__(self, hz: float, duration_s: float) -> None:
        super().__init__()
        self._hz, self._duration_s = hz, duration_s
        self.plain.get_io().config_flags |= self.plain.ConfigFlags_.docking_enable
        _, glfw = import_parts()
        self._glfw = _GlfwState(glfw)
        backend = SimpleNamespace(keyboard_callback=self._give_key, char_callback=lambda *_: None)
        self.keys = Keyboard(self.imgui, self._glfw, None, backend)
        self.seconds, self.asked_s = 0.0, math.inf
        self._events: list[_Event] = []
        self._clicks: list[tuple[float, str, bool | None]] = []
        self.font_scale = 1.0
        self.capture, self.captured = False, None

    @property
    def open(self) -> bool:
        return self.seconds < self._duration_s

    def stay_open(self) -> None:
        """The close button was pressed: the window stays while the console asks."""
        self.asked_s, self._duration_s = self.seconds, self._duration_s + 1.0

    def hold(self, key: str, t_s: float, length_s: float, *, ctrl: bool = False) -> None:
        """Have a key go down, repeat and go up."""
        glfw = self._glfw
        times = [(t_s, glfw.PRESS), (t_s + length_s, glfw.RELEASE)]
        repeats = max(int((length_s - REPEAT_DELAY_S) / REPEAT_EVERY_S), 0)
        times += [(t_s + REPEAT_DELAY_S + k * REPEAT_EVERY_S, glfw.REPEAT) for k in range(repeats)]
        self._events += [
            _Event(t, len(self._events) + k, key, action, ctrl) for k, (t, action) in enumerate(times)
        ]
        self._events.sort()

    def click(self, label: str, t_s: float, length_s: float = 0.04) -> None:
        """Have the left button go down and up on the control with this label."""
        self._clicks += [(t_s - 0.01, label, None), (t_s, label, True), (t_s + length_s, label, False)]

    def lose_focus(self, t_s: float) -> None:
        """Have glfw report a release of every key, as it does when the window loses the focus."""
        self._events = [e for e in self._events if e.t_s < t_s or e.action == self._glfw.PRESS]
        self._events += [
            _Event(t_s, len(self._events) + k, key, self._glfw.RELEASE)
            for k, key in enumerate({e.key for e in self._events})
        ]
        self._events.sort()

    def wait(self, longest_s: float) -> bool:
        self.seconds += max(longest_s, 1e-4)
        came = False
        while self._clicks and self._clicks[0][0] <= self.seconds:
            _, label, down = self._clicks.pop(0)
            came, io = True, self.plain.get_io()
            if down is None:
                io.add_mouse_pos_event(*next(n.middle for n in self.noted if n.label.startswith(label)))
            else:
                io.add_mouse_button_event(0, down)
        while self._events and self._events[0].t_s <= self.seconds:
            event, came = self._events.pop(0), True
            key = self.keys.code(event.key)
            if event.action == self._glfw.RELEASE:
                self._glfw.down.discard(key)
            else:
                self._glfw.down.add(key)
            self.keys.queue.key(None, key, 0, event.action, self._glfw.MOD_CONTROL if event.ctrl else 0)
        return came

    def _give_key(self, _window: object, key: int, _scancode: int, action: int, modifiers: int) -> None:
        io, imgui = self.plain.get_io(), self.plain
        names = ("w", "a", "d", "x", "h", "q", "delete", "escape", "insert", "f1", "f9")
        name = next(n for n in names if self.keys.code(n) == key)
        down = action != self._glfw.RELEASE
        io.add_key_event(imgui.Key.mod_ctrl, bool(modifiers & self._glfw.MOD_CONTROL) and down)
        io.add_key_event(getattr(imgui.Key, name), down)

    @contextmanager
    def frame(self) -> Iterator[None]:
        self.keys.queue.deliver()
        self.noted.clear()
        self.plain.get_io().delta_time = 1 / self._hz
        self.plain.new_frame()
        yield
        self.plain.render()
        self.seconds += 1 / self._hz

    def gamepad(self) -> None:
        return None

    def take_dropped(self) -> list[str]:
        return []
