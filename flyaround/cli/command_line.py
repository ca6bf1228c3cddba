"""The words on the command line, for the records of runs."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_WORDS: ContextVar[tuple[str, ...]] = ContextVar("command line", default=())


def command_line() -> tuple[str, ...]:
    """Return the command as it was typed; nothing if a program called it otherwise."""
    return _WORDS.get()


@contextmanager
def typed(arguments: Sequence[str]) -> Iterator[None]:
    """Have `command_line` return the arguments of the command that is called."""
    token = _WORDS.set(("flyaround", *arguments))
    try:
        yield
    finally:
        _WORDS.reset(token)
