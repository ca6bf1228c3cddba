"""Undo and redo of an operator's settings: overlays, exposure, layers, maps. The flight has its timeline instead."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.gui.picture.view_settings import Options

MAX_STEPS = 200  # steps that can be undone
ONE_DRAG_MS = 800
"""Interval within which consecutive changes by one command, as of a dragged slider, count as one."""
GROUPS = frozenset(
    ["overlay", "picture", "world", "window", "map", "orbit-camera", "camera", "sensor", "light"]
)
KEEP_OUT = "docking.keep-out"
"""Groups of the commands that can be undone, and one more command."""

Values = dict[tuple[str, str], Any]
"""Values by part of the settings and field; the field of a part that is undone as a whole is empty."""
Steps = list[tuple[str, Values]]
SPLIT = ("settings", "overlays")  # parts whose fields are undone one by one


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
        if not former or not (command == KEEP_OUT or command.partition(".")[0] in GROUPS):
            return
        name, then_ms = self._last
        self._last = (command, t_ms)
        self._redo.clear()
        if name == command and t_ms - then_ms < ONE_DRAG_MS and self._undo:
            former |= self._undo.pop()[1]
        self._undo = [*self._undo[-MAX_STEPS + 1 :], (change or command, former)]

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


def _values(options: Options) -> Values:
    """Return all settings by part and field."""
    return {
        (part, name): value
        for part, whole in vars(options).items()
        for name, value in (vars(whole).items() if part in SPLIT else [("", whole)])
    }


def _swap(options: Options, source: Steps, other: Steps, advice: str) -> str:
    """Restore the values of the last step of ``source``, push the present ones to ``other``; return the change."""
    if not source:
        raise UserError(advice)
    change, former = source.pop()
    now = _values(options)
    other.append((change, deepcopy({key: now[key] for key in former})))
    for (part, name), value in former.items():
        setattr(getattr(options, part) if name else options, name or part, value)
    return change
