"""Progress of slow preparations, as one line of text that another process reads."""

from __future__ import annotations

import multiprocessing
import threading
from ctypes import c_char
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from concurrent.futures import Future

# Size of the shared line of text [bytes].
_LINE_BYTES = 96


class ProgressLine:
    """A line of text in memory shared with child processes."""

    def __init__(self) -> None:
        self._memory = multiprocessing.get_context("spawn").RawArray(c_char, _LINE_BYTES)

    def read(self) -> str:
        """Return the newest text.

        Returns
        -------
        str
            Text of up to 95 bytes in UTF-8; empty while nothing is prepared.
        """
        return bytes(self._memory.value).decode(errors="ignore")

    def write(self, text: str) -> None:
        """Replace the text."""
        self._memory.value = text.encode()[: _LINE_BYTES - 1]


class _Reporter:
    """The preparations of this process, and the line that reports them."""

    def __init__(self) -> None:
        self.line: ProgressLine | None = None
        self._steps: dict[str, Future[Any]] = {}
        self._lock = threading.Lock()

    def watch(self, steps: Mapping[str, Future[Any]]) -> None:
        if self.line is None:
            return
        with self._lock:
            if all(step.done() for step in self._steps.values()):
                self._steps.clear()
            self._steps.update(steps)
        for step in steps.values():
            step.add_done_callback(self._report)
        self._report()

    def _report(self, _: Future[Any] | None = None) -> None:
        with self._lock:
            waiting = [name for name, step in self._steps.items() if not step.done()]
            # drawing is the last step
            count = len(self._steps) + 1
            if self.line is not None:
                self.line.write(f"{(*waiting, 'picture')[0]}, {count - len(waiting)} of {count}")


_reporter = _Reporter()


def publish_progress(line: ProgressLine) -> None:
    """Write the progress of this process to a line from now on."""
    _reporter.line = line
    line.write("the renderer")


def watch_steps(steps: Mapping[str, Future[Any]]) -> None:
    """Report named preparations that have begun; does nothing unless the progress is published.

    Parameters
    ----------
    steps : mapping
        Futures by name for people, in the order in which they should end.
    """
    _reporter.watch(steps)
