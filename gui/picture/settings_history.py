"""Undo and redo of an operator's settings: overlays, exposure, layers, maps. The flight has its timeline instead."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.gui.picture.view_settings import Options

MAX_STEPS = 200  # steps that can be undone
ONE_DRAG_MS = 800
"""Interval within which consecutive changes by one command, as of a dragged slider, count as one."""


class SettingsHistory:
    """The settings before each command that changed them, with words on the change."""

    def __init__(self) -> None:
        self._undo: list[tuple[str, Options]] = []
        self._redo: list[tuple[str, Options]] = []
        self._last: tuple[str, int] = ("", -ONE_DRAG_MS)

    def note(self, command: str, before: Options, after: Options, t_ms: int, change: str = "") -> None:
        """Record the settings before a command, if it changed them.

        Parameters
        ----------
        command : str
            Name of the command.
        before : Options
            Copy of the settings before the command.
        after : Options
            Settings after the command.
        t_ms : int
            Real time.
        change : str, optional
            The change in words, by default the command's name.
        """
        if before == after:
            return
        name, then_ms = self._last
        self._last = (command, t_ms)
        self._redo.clear()
        if name == command and t_ms - then_ms < ONE_DRAG_MS and self._undo:
            before = self._undo.pop()[1]
        self._undo = [*self._undo[-MAX_STEPS + 1 :], (change or command, before)]

    def next(self, command: str) -> str | None:
        """Return the change that ``settings.undo`` or ``settings.redo`` would act on; None of other commands."""
        steps = {"settings.undo": self._undo, "settings.redo": self._redo}.get(command)
        return None if steps is None else steps[-1][0] if steps else ""

    def undo(self, options: Options) -> str:
        """Restore the settings before the last change, and return that change in words.

        Raises
        ------
        UserError
            If there is none.
        """
        self._last = ("", -ONE_DRAG_MS)
        return _swap(options, self._undo, self._redo, "there is no change of settings to undo")

    def redo(self, options: Options) -> str:
        """Repeat the change that was undone last, and return it in words.

        Raises
        ------
        UserError
            If nothing was.
        """
        self._last = ("", -ONE_DRAG_MS)
        return _swap(options, self._redo, self._undo, "there is nothing to redo")


Steps = list[tuple[str, "Options"]]


def _swap(options: Options, source: Steps, other: Steps, advice: str) -> str:
    """Restore the last settings of ``source``, push the present ones to ``other``, and return the change."""
    if not source:
        raise UserError(advice)
    change, settings = source.pop()
    other.append((change, deepcopy(options)))
    vars(options).update(vars(settings))
    return change
