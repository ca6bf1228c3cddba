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
    from flyaround.simulator.piloting.orders import Changes

MAX_STEPS = 200  # steps that can be undone
ONE_DRAG_MS = 800
"""Interval within which consecutive changes by one command, as of a dragged slider, count as one."""
UNDONE = texts("undo")["commands"]
"""Commands that can be undone; ``*`` stands for the rest of a name."""

Values = dict[tuple[str, str], Any]
"""Values by part of the settings and field; the field of a part that is undone as a whole is empty."""
Steps = list[tuple[str, Values, Values]]
"""Each change in words, with the values after and before it; to redo a step, the values before and after it."""
FLIGHT = "flight"
SPLIT = ("settings", "overlays", FLIGHT)  # parts whose fields are undone one by one


class SettingsHistory:
    """The former value of each setting that a command changed, with words on the change."""

    def __init__(self) -> None:
        self._steps: dict[str, Steps] = {"settings.undo": [], "settings.redo": []}
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
        steps = self._steps["settings.undo"]
        self._steps["settings.redo"].clear()
        # each burn is a step of its own
        one_drag = name == command and t_ms - then_ms < ONE_DRAG_MS and not command.startswith("burn.")
        if one_drag and steps:
            former |= steps.pop()[2]
        steps.append((change or command, deepcopy({key: now[key] for key in former}), former))
        del steps[:-MAX_STEPS]

    def next(self, command: str) -> str | None:
        """Return the change that ``settings.undo`` or ``settings.redo`` would act on; None of other commands."""
        steps = self._steps.get(command)
        return None if steps is None else steps[-1][0] if steps else ""

    def next_of_flight(self, command: str) -> Changes:
        """Return what ``settings.undo`` or ``settings.redo`` would change of the flight; nothing of other commands."""
        steps = self._steps.get(command)
        return _of_flight(steps[-1]) if steps else {}

    def step(self, command: str, options: Options, fly: Callable[[Changes], object]) -> str:
        """Undo or redo the last change, and return it in words.

        Parameters
        ----------
        command : str
            ``settings.undo`` or ``settings.redo``.
        options : Options
            Settings.
        fly : callable
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
        self._last = ("", -ONE_DRAG_MS)
        source = self._steps[command]
        (other,) = (steps for name, steps in self._steps.items() if name != command)
        if not source:
            missing = "no change to undo" if command == "settings.undo" else "nothing to redo"
            raise UserError(f"there is {missing}")
        change, leaves, reaches = step = source.pop()
        if changes := _of_flight(step):
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
