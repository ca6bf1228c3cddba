"""Queue of keys and clicks ahead of a slow window: none is delivered before the effect of the previous one is drawn."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

REST_FRAMES = 3
"""Frames without keys after a click, or a key with Ctrl, Escape or Enter, in which the window draws its effect."""
CLICK = -1
"""Key of the events of mouse buttons."""

PRINTABLE = range(32, 97)
"""Glfw's keys of characters."""


class Event(NamedTuple):
    """An event of a key, letter or mouse button that waits for a frame.

    Parameters
    ----------
    take : callable
        Function that delivers the event.
    key : int or None
        None for a letter, `CLICK` for a mouse button.
    turns : bool, optional
        True if it may begin or end text input.
    pressed : bool, optional
        False for a release.
    """

    take: Callable[[], None]
    key: int | None
    turns: bool = False
    pressed: bool = True


class KeyQueue:
    """Key and letter events in order, delivered before each frame.

    A window at three frames per second gets Ctrl+P and the letters of a command at once. The text field appears some
    frames later; until then the letters would act as keys that steer.

    Parameters
    ----------
    glfw : object
        The module of glfw, for its constants.
    on_key : callable
        Function of window, key, scancode, action and modifiers, as in glfw.
    on_letter : callable
        Callback of a window and a code point.
    urgent : callable
        Predicate for keys whose press overtakes the queue. It discards earlier presses, but never overtakes a key
        that may begin or end text input.
    typing : callable
        Predicate for a field that takes text. Its characters arrive as letters, so presses of printable keys are
        dropped, and a line of text needs one frame instead of one per character.
    """

    def __init__(
        self,
        glfw: Any,  # noqa: ANN401 - a foreign module
        on_key: Callable[..., None],
        on_letter: Callable[..., None],
        urgent: Callable[[int], bool],
        typing: Callable[[], bool],
    ) -> None:
        self._glfw, self._on_key, self._on_letter = glfw, on_key, on_letter
        self._turns = {glfw.KEY_ESCAPE, glfw.KEY_ENTER, glfw.KEY_KP_ENTER}
        """Keys that begin or end text input by themselves."""
        self._urgent, self._typing = urgent, typing
        self._events: deque[Event] = deque()
        self._rest = 0

    def __len__(self) -> int:
        """Return the number of queued events."""
        return len(self._events)

    def key(self, window: object, key: int, scancode: int, action: int, modifiers: int) -> None:
        """Queue a key press or release; repeats are dropped, because holding is a state."""
        if action == self._glfw.REPEAT:
            return
        pressed = action == self._glfw.PRESS
        turns = pressed and (key in self._turns or bool(modifiers & self._glfw.MOD_CONTROL))
        event = Event(lambda: self._on_key(window, key, scancode, action, modifiers), key, turns, pressed)
        urgent = pressed and not turns and self._urgent(key)
        if urgent and not self._rest and not any(e.turns for e in self._events):
            self._events = deque((event, *(e for e in self._events if e.key != key and not e.pressed)))
        else:
            self._events.append(event)

    def letter(self, window: object, code_point: int) -> None:
        """Queue a typed letter."""
        self._events.append(Event(lambda: self._on_letter(window, code_point), None))

    def click(self, take: Callable[[], None]) -> None:
        """Queue a press or release of a mouse button, which may begin or end text input; ``take`` delivers it."""
        self._events.append(Event(take, CLICK, turns=True, pressed=False))

    def deliver(self) -> None:
        """Deliver the events since the last frame, up to the first key that may begin or end text input.

        No more than Dear ImGui processes in one frame: no key twice, no such key after a letter, and no letter after a
        key without a character, as Shift; it would queue the rest beyond our pause. Only keys pause: a double click
        must not take longer in a slow window.
        """
        resting = self._rest > 0
        self._rest -= resting
        keys_seen, typed, shifted = set[int](), False, False
        while self._events:
            event = self._events[0]
            if resting and event.key != CLICK:
                return
            printable = not event.turns and event.key in PRINTABLE and self._typing()
            if event.key in keys_seen or (typed and event.turns) or (shifted and event.key is None):
                return
            self._events.popleft()
            if not (printable and event.pressed):
                event.take()
            if event.key is None:
                typed = True
            elif not printable:
                keys_seen.add(event.key)
                shifted |= event.key not in PRINTABLE
            if event.turns:
                self._rest, resting = REST_FRAMES, True
