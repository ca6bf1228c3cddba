"""The keyboard of a window: keys held, keys pressed, and text input."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from flyaround.gui.key_queue import KeyQueue


class Keys:
    """The keys of a surface, by their names in Dear ImGui; none without a keyboard."""

    @property
    def typing(self) -> bool:
        """True while a field takes text."""
        return False

    @property
    def ctrl(self) -> bool:
        """True while a Ctrl key is down."""
        return False

    def set_urgent(self, names: Iterable[str]) -> None:
        """Set the keys that overtake queued ones in a slow window."""

    def held(self, names: Iterable[str]) -> list[str]:  # noqa: ARG002 - of a keyboard
        """Return which keys are held."""
        return []

    def still_held(self, names: Iterable[str]) -> list[str]:  # noqa: ARG002 - of a keyboard
        """Return the keys for which neither release nor loss of focus has been reported."""
        return []

    def hit(self, names: Iterable[str]) -> list[str]:  # noqa: ARG002 - of a keyboard
        """Return the keys that went down since the last frame."""
        return []


class Keyboard(Keys):
    """The keyboard of a window.

    Parameters
    ----------
    imgui : object
        The module of Dear ImGui.
    glfw : object
        The module of glfw.
    native : object
        Glfw's window.
    backend : object
        Renderer of Dear ImGui, whose callbacks take keys and letters with glfw's arguments.
    """

    def __init__(
        self,
        imgui: Any,  # noqa: ANN401 - a foreign module
        glfw: Any,  # noqa: ANN401 - a foreign module
        native: object,
        backend: Any,  # noqa: ANN401 - of a foreign module
    ) -> None:
        self._imgui, self._glfw, self._native = imgui, glfw, native
        self._urgent: frozenset[int] = frozenset()
        self.queue = KeyQueue(
            glfw,
            backend.keyboard_callback,
            backend.char_callback,
            urgent=lambda key: key in self._urgent and not self.typing,
            typing=lambda: self.typing,
        )

    @property
    def typing(self) -> bool:
        """True while a field takes text."""
        return bool(self._imgui.get_io().want_text_input)

    def set_urgent(self, names: Iterable[str]) -> None:
        """Choose the keys that overtake those waiting for a slow window."""
        self._urgent = frozenset(self.code(n) for n in names)

    def held(self, names: Iterable[str]) -> list[str]:
        """Return the held keys; none during text input.

        A key counts from the delivery of its press until its actual release, whatever is queued.
        """
        return self.still_held(self._where(names, self._imgui.is_key_down))

    def still_held(self, names: Iterable[str]) -> list[str]:
        """Return the keys for which neither release nor loss of focus has been reported."""
        glfw, native = self._glfw, self._native
        return [n for n in names if glfw.get_key(native, self.code(n)) == glfw.PRESS]

    def code(self, name: str) -> int:
        """Return the code of a key in glfw, by its name in Dear ImGui."""
        glfw_name = name.removesuffix("_arrow").replace("keypad", "kp").replace("ctrl", "control")
        return int(getattr(self._glfw, f"KEY_{glfw_name.upper()}"))

    def hit(self, names: Iterable[str]) -> list[str]:
        """Return the keys that went down since the last frame; during text input only F1 to F12."""
        return self._where(names, lambda key: self._imgui.is_key_pressed(key, False), typed=True)

    def _where(
        self, names: Iterable[str], pressed: Callable[[Any], bool], *, typed: bool = False
    ) -> list[str]:
        if self._imgui.get_io().want_text_input:
            names = [n for n in names if typed and n[:1] == "f" and n[1:].isdigit()]
        return [n for n in names if pressed(getattr(self._imgui.Key, f"_{n}" if n.isdigit() else n))]

    @property
    def ctrl(self) -> bool:
        """True while a Ctrl key is down."""
        return bool(self._imgui.get_io().key_ctrl)
