"""Keys and letters that were typed ahead of a slow window: none is taken before what the last key opened is there."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Event = tuple[Callable[[], None], int | None, bool]

REST_FRAMES = 3
"""After a key with Ctrl, Escape or Enter: the window draws what it opens or closes before more is taken."""


class KeyQueue:
    """Key and letter events in their order, delivered before each frame.

    A window of three frames a second gets Ctrl+P and the letters of a command in one go. The line that takes them is
    there some frames later; until then they would be keys that steer.

    Parameters
    ----------
    on_key : takes window, key, scancode, action and modifiers, as glfw gives them. on_letter : window and code point.
    pressed, ctrl : glfw's action of a key that goes down, and its bit of the Ctrl key.
    turns : keys that begin or end a line of text by themselves.
    """

    def __init__(
        self,
        on_key: Callable[..., None],
        on_letter: Callable[..., None],
        *,
        pressed: int,
        ctrl: int,
        turns: Iterable[int],
    ) -> None:
        self._on_key, self._on_letter = on_key, on_letter
        self._pressed, self._ctrl, self._turns = pressed, ctrl, frozenset(turns)
        self._events: deque[Event] = deque()
        self._rest = 0

    def __len__(self) -> int:
        """Events that wait."""
        return len(self._events)

    def key(self, window: object, key: int, scancode: int, action: int, modifiers: int) -> None:
        """One key went down, up, or repeats."""
        turns = action == self._pressed and (key in self._turns or bool(modifiers & self._ctrl))
        self._events.append((lambda: self._on_key(window, key, scancode, action, modifiers), key, turns))

    def letter(self, window: object, code_point: int) -> None:
        """One letter was typed."""
        self._events.append((lambda: self._on_letter(window, code_point), None, False))

    def deliver(self) -> None:
        """Before a frame: what came since the last, as far as the first key that may begin or end a line of text.

        No more than Dear ImGui takes in a frame: no key twice, and no such key after a letter; the rest of it would
        wait there, and the frames of rest be over too soon.
        """
        if self._rest:
            self._rest -= 1
            return
        changed: set[int] = set()
        typed = False
        while self._events:
            take, key, turns = self._events[0]
            if key in changed or (typed and turns):
                return
            self._events.popleft()
            take()
            if key is None:
                typed = True
            else:
                changed.add(key)
            if turns:
                self._rest = REST_FRAMES
                return
