"""Ctrl-C and SIGTERM around the end of a run: its books are closed first."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def signals_held() -> Iterator[None]:
    """SIGINT and SIGTERM wait until what is inside is done; what takes short and bounded time belongs here.

    Who stops a program often sends the signal twice (``timeout``, an impatient Ctrl-C): the second must not break off
    what the first began. Where an exception is on its way already, from inside or from before, they are forgotten: it
    ends the run as well.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is told of signals
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda number, _frame: came.append(number)) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
    if came and sys.exc_info()[0] is None:
        signal.raise_signal(signal.Signals(came[0]))
