"""Literal text on the terminal, without Rich's mark-up (square brackets, `:names:`), and a progress bar.

Names from files may contain control characters, which are printed as escapes.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from rich.console import ConsoleOptions, RenderableType
    from rich.segment import Segment

# C0 and C1 controls, marks that reverse the text direction, and surrogates of undecodable bytes
_CONTROL_CHARACTERS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def escape_control_characters(text: str) -> str:
    """Return a text with control characters as Python escapes, except tabs and line ends."""
    return _CONTROL_CHARACTERS.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


class VisibleConsole(Console):
    """Console that escapes control characters in texts."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render the segments of a text, table or bar."""
        for segment in super().render(renderable, options):
            yield (
                segment if segment.control else segment._replace(text=escape_control_characters(segment.text))
            )


def terminal(*, stderr: bool = False) -> Console:
    """Return a console that prints texts and table cells literally, on standard output or standard error.

    Returns
    -------
    Console
        Console without markup, emoji or highlighting, which escapes control characters.
    """
    return VisibleConsole(stderr=stderr, markup=False, emoji=False, highlight=False)


def say(text: RenderableType, *, stderr: bool = False) -> None:
    """Print a sentence without wrapping, so that paths stay in one piece."""
    terminal(stderr=stderr).print(text, soft_wrap=True)


@contextmanager
def progress_bar(what: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on the error stream, if it is a terminal and not ``quiet``; yield ``update(done, total)``."""
    from rich.progress import (  # noqa: PLC0415 - slow to import, and not needed for help pages
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description:24}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=terminal(stderr=True), disable=quiet)
    task = bar.add_task(what, total=None)

    def update(done: int, total: int) -> None:
        # shown at the first step, so that an earlier error is printed alone
        bar.start()
        bar.update(task, completed=done, total=total)

    try:
        yield update
    finally:
        bar.stop()


def with_literal_help(command: Any) -> Any:  # noqa: ANN401 - click's commands, groups and parameters
    """Return a command whose help pages show square brackets literally: ``[kg]``, ``'flyaround[gui]'``."""
    for node in (command, *command.params):
        text = getattr(node, "help", None)
        if text:
            node.help = escape(text)
    for inner in getattr(command, "commands", {}).values():
        with_literal_help(inner)
    return command
