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
    """The settings before each command that changed them."""

    def __init__(self) -> None:
        self._undo: list[Options] = []
        self._redo: list[Options] = []
        self._last: tuple[str, int] = ("", -ONE_DRAG_MS)

    def note(self, command: str, before: Options, after: Options, t_ms: int) -> None:
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
        """
        if before == after:
            return
        name, then_ms = self._last
        self._last = (command, t_ms)
        self._redo.clear()
        if name == command and t_ms - then_ms < ONE_DRAG_MS and self._undo:
            return
        self._undo = [*self._undo[-MAX_STEPS + 1 :], before]

    def undo(self, options: Options) -> None:
        """Restore the settings before the last change.

        Raises
        ------
        UserError
            If there is none.
        """
        _swap(options, self._undo, self._redo, "there is no change of settings to undo")
        self._last = ("", -ONE_DRAG_MS)

    def redo(self, options: Options) -> None:
        """Repeat the change that was undone last.

        Raises
        ------
        UserError
            If nothing was.
        """
        _swap(options, self._redo, self._undo, "there is nothing to do again")
        self._last = ("", -ONE_DRAG_MS)


def _swap(options: Options, source: list[Options], other: list[Options], advice: str) -> None:
    """Restore the last settings of ``source``, and push the present ones to ``other``."""
    if not source:
        raise UserError(advice)
    other.append(deepcopy(options))
    vars(options).update(vars(source.pop()))
