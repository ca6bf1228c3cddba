"""The command line as typed, for the records of runs."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_WORDS: ContextVar[tuple[str, ...]] = ContextVar("command line", default=())


def command_line() -> tuple[str, ...]:
    """Return the command as typed; empty if a program called the function directly."""
    return _WORDS.get()


@contextmanager
def typed(arguments: Sequence[str]) -> Iterator[None]:
    """Set the arguments that `command_line` returns, for the duration of a call."""
    token = _WORDS.set(("flyaround", *arguments))
    try:
        yield
    finally:
        _WORDS.reset(token)
