"""Undo and redo of an operator's settings, and of choices and burns of the flight, which else has its timeline."""

from __future__ import annotations

from copy import deepcopy
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from flyaround.gui.texts import texts
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.picture.view_settings import Options

MAX_STEPS = 200  # steps that can be undone
ONE_DRAG_MS = 800
"""Interval within which consecutive changes by one command, as of a dragged slider, count as one."""
UNDONE = texts("undo")["commands"]
"""Commands that can be undone; ``*`` stands for the rest of a name."""

Values = dict[tuple[str, str], Any]
"""Values by part of the settings and field; the field of a part that is undone as a whole is empty."""
Steps = list[tuple[str, Values, Values]]
"""Each change in words, with the values after and before it; to redo a step, the values before and after it."""
Changes = dict[str, tuple[Any, Any]]
"""Values of the flight's choices before and after a change, by field."""
FLIGHT = "flight"
SPLIT = ("settings", "overlays", FLIGHT)  # parts whose fields are undone one by one


class SettingsHistory:
    """The former value of each setting that a command changed, with words on the change."""

    def __init__(self) -> None:
        self._undo: Steps = []
        self._redo: Steps = []
        self._last: tuple[str, int] = ("", -ONE_DRAG_MS)

    def note(self, command: str, before: Options, after: Options, t_ms: int, change: str = "") -> None:
        """Record the settings that a command changed, if they are those of its name.

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
        now = _values(after)
        former = {key: value for key, value in _values(before).items() if value != now[key]}
        if not former or not any(fnmatchcase(command, pattern) for pattern in UNDONE):
            return
        name, then_ms = self._last
        self._last = (command, t_ms)
        self._redo.clear()
        # each burn is a step of its own
        one_drag = name == command and t_ms - then_ms < ONE_DRAG_MS and not command.startswith("burn.")
        if one_drag and self._undo:
            former |= self._undo.pop()[2]
        latter = deepcopy({key: now[key] for key in former})
        self._undo = [*self._undo[-MAX_STEPS + 1 :], (change or command, latter, former)]

    def next(self, command: str) -> str | None:
        """Return the change that ``settings.undo`` or ``settings.redo`` would act on; None of other commands."""
        steps = {"settings.undo": self._undo, "settings.redo": self._redo}.get(command)
        return None if steps is None else steps[-1][0] if steps else ""

    def next_of_flight(self, command: str) -> Changes:
        """Return what ``settings.undo`` or ``settings.redo`` would change of the flight; nothing of other commands."""
        steps = self._undo if command == "settings.undo" else self._redo
        return _of_flight(steps[-1]) if self.next(command) else {}

    def undo(self, options: Options, fly: Callable[[Changes], object] | None = None) -> str:
        """Restore the settings before the last change, and return that change in words.

        Parameters
        ----------
        options : Options
            Settings.
        fly : callable, optional
            Function that changes the flight; if it raises an error, the step is dropped.

        Returns
        -------
        str
            The change.

        Raises
        ------
        UserError
            If there is none, or it can no longer be undone.
        """
        return self._restore(options, self._undo, self._redo, "there is no change to undo", fly)

    def redo(self, options: Options, fly: Callable[[Changes], object] | None = None) -> str:
        """Repeat the change that was undone last; parameters and result are those of `undo`."""
        return self._restore(options, self._redo, self._undo, "there is nothing to redo", fly)

    def _restore(
        self,
        options: Options,
        source: Steps,
        other: Steps,
        advice: str,
        fly: Callable[[Changes], object] | None,
    ) -> str:
        self._last = ("", -ONE_DRAG_MS)
        if not source:
            raise UserError(advice)
        change, leaves, reaches = step = source.pop()
        if fly is not None and (changes := _of_flight(step)):
            try:
                fly(changes)
            except UserError as error:
                raise UserError(f"{change}: {error}") from error
        other.append((change, reaches, leaves))
        for (part, name), value in deepcopy(reaches).items():
            if part != FLIGHT:
                setattr(getattr(options, part) if name else options, name or part, value)
        return change


def _of_flight(step: tuple[str, Values, Values]) -> Changes:
    _, leaves, reaches = step
    return {name: (leaves[part, name], value) for (part, name), value in reaches.items() if part == FLIGHT}


def _values(options: Options) -> Values:
    """Return all settings by part and field."""
    return {
        (part, name): value
        for part, whole in vars(options).items()
        for name, value in (vars(whole).items() if part in SPLIT and whole is not None else [("", whole)])
    }
