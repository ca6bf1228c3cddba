"""Text on the terminal as it is written: Rich would take square brackets for mark-up and `:names:` for pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from rich.console import RenderableType


def terminal(*, stderr: bool = False) -> Console:
    """A console of the output or the error stream that prints text and the cells of tables to the letter."""
    return Console(stderr=stderr, markup=False, emoji=False, highlight=False)


def say(text: RenderableType, *, stderr: bool = False) -> None:
    """Print a sentence; the terminal breaks a line that is too long, so that a path stays in one piece."""
    terminal(stderr=stderr).print(text, soft_wrap=True)


def with_literal_help(command: Any) -> Any:  # noqa: ANN401 - click's commands, groups and parameters alike
    """A command whose help pages, and those of its commands, show square brackets: ``[kg]``, ``'flyaround[gui]'``."""
    for thing in (command, *command.params):
        text = getattr(thing, "help", None)
        if text:
            thing.help = escape(text)
    for inner in getattr(command, "commands", {}).values():
        with_literal_help(inner)
    return command
