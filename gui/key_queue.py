"""Keys and letters that were typed ahead of a slow window: none is taken before what the last key opened is there."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

REST_FRAMES = 3
"""After a key with Ctrl, Escape or Enter: the window draws what it opens or closes before more is taken."""


class Event(NamedTuple):
    """A key or letter event that waits for a frame.

    Parameters
    ----------
    take : hands the event over. key : None for a letter. turns : whether it may begin or end a line of text.
    pressed : False when a key went up.
    """

    take: Callable[[], None]
    key: int | None
    turns: bool
    pressed: bool


class KeyQueue:
    """Key and letter events in their order, delivered before each frame.

    A window of three frames a second gets Ctrl+P and the letters of a command in one go. The line that takes them is
    there some frames later; until then they would be keys that steer.

    Parameters
    ----------
    on_key : takes window, key, scancode, action and modifiers, as glfw gives them. on_letter : window and code point.
    pressed, released, ctrl : glfw's actions of a key that goes down and up, and its bit of the Ctrl key.
    turns : keys that begin or end a line of text by themselves.
    urgent : predicate of a key, whether its press overtakes what waits. It discards the presses before it, and never
        overtakes a key that may begin or end a line of text.
    """

    def __init__(
        self,
        on_key: Callable[..., None],
        on_letter: Callable[..., None],
        *,
        pressed: int,
        released: int,
        ctrl: int,
        turns: Iterable[int],
        urgent: Callable[[int], bool] = lambda _key: False,
    ) -> None:
        self._on_key, self._on_letter = on_key, on_letter
        self._pressed, self._released, self._ctrl = pressed, released, ctrl
        self._turns, self._urgent = frozenset(turns), urgent
        self._events: deque[Event] = deque()
        self._rest = 0

    def __len__(self) -> int:
        """Events that wait."""
        return len(self._events)

    def key(self, window: object, key: int, scancode: int, action: int, modifiers: int) -> None:
        """Take a key that went down or up. Its repeats are dropped: holding is a state, not a queue."""
        if action not in (self._pressed, self._released):
            return
        pressed = action == self._pressed
        turns = pressed and (key in self._turns or bool(modifiers & self._ctrl))
        event = Event(lambda: self._on_key(window, key, scancode, action, modifiers), key, turns, pressed)
        if (
            pressed
            and not turns
            and self._urgent(key)
            and not (self._rest or any(e.turns for e in self._events))
        ):
            self._events = deque((event, *(e for e in self._events if e.key != key and not e.pressed)))
        else:
            self._events.append(event)

    def letter(self, window: object, code_point: int) -> None:
        """Queue a typed letter."""
        self._events.append(
            Event(lambda: self._on_letter(window, code_point), None, turns=False, pressed=True)
        )

    def deliver(self) -> None:
        """Hand over the events since the last frame, up to the first key that may begin or end a line of text.

        No more than Dear ImGui takes in a frame: no key twice, and no such key after a letter; the rest of it would
        wait there, and the frames of rest be over too soon.
        """
        if self._rest:
            self._rest -= 1
            return
        changed: set[int] = set()
        typed = False
        while self._events:
            event = self._events[0]
            if event.key in changed or (typed and event.turns):
                return
            self._events.popleft()
            event.take()
            if event.key is None:
                typed = True
            else:
                changed.add(event.key)
            if event.turns:
                self._rest = REST_FRAMES
                return
