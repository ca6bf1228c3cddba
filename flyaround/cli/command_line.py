"""The command line as typed, for the records of runs."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_COMMAND_LINE: ContextVar[tuple[str, ...]] = ContextVar("command line", default=())


def command_line() -> tuple[str, ...]:
    """Return the command as typed; empty if a program called the function directly."""
    return _COMMAND_LINE.get()


@contextmanager
def set_command_line(arguments: Sequence[str]) -> Iterator[None]:
    """Set the arguments that `command_line` returns, for the duration of a call."""
    token = _COMMAND_LINE.set(("flyaround", *arguments))
    try:
        yield
    finally:
        _COMMAND_LINE.reset(token)
