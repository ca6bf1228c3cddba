"""A command of Flyaround that runs beside the window: its output in a file, polled, ended in a bounded time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

PATIENCE_S = 8.0
"""Time that a program has to end before it is killed."""
MOST_BYTES = 200_000
"""Of a program's output that are read."""


class ChildProgram:
    """``flyaround`` with arguments, in a process of its own.

    Parameters
    ----------
    arguments : after ``flyaround``. clock : seconds, monotonic.

    Raises
    ------
    OSError
        If it cannot be started.
    """

    def __init__(self, arguments: Sequence[str], clock: Callable[[], float] = time.monotonic) -> None:
        self.arguments = tuple(arguments)
        self._clock = clock
        self._told_s: float | None = None
        # -P: no folder named hil in the working directory is taken for ours
        command = [sys.executable, "-P", "-m", "flyaround", *arguments]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        self._out, self._err = (tempfile.TemporaryFile() for _ in range(2))  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=self._out, stderr=self._err
        )

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True while it runs; kills it if it was asked to end and does not."""
        if self._process.poll() is not None:
            return False
        if self._told_s is not None and self._clock() - self._told_s > PATIENCE_S:
            self._process.kill()
        return True

    @property
    def exit_code(self) -> int | None:
        """Its exit code; None while it runs."""
        return self._process.poll()

    @property
    def stopped(self) -> bool:
        """True once it was asked to end."""
        return self._told_s is not None

    def stop(self) -> None:
        """Interrupt it as Ctrl-C does; a second call kills it."""
        if self._process.poll() is not None:
            return
        with contextlib.suppress(OSError):
            self._process.send_signal(signal.SIGINT if self._told_s is None else signal.SIGKILL)
        self._told_s = self._told_s or self._clock()

    def output(self) -> str:
        """Return its standard output, truncated."""
        return _read(self._out.fileno())

    def last_words(self) -> str:
        """Return the last line on its error stream, without the program's name."""
        lines = [line.strip() for line in _read(self._err.fileno()).splitlines() if line.strip()]
        return lines[-1].removeprefix("flyaround: ") if lines else ""

    def close(self, patience_s: float = 2.0) -> None:
        """End it, waiting a little; then it is killed."""
        self.stop()
        try:
            self._process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._out.close()
        self._err.close()


def _read(fd: int) -> str:
    return os.pread(fd, MOST_BYTES, 0).decode("utf-8", errors="replace")


def new_folder(base: Path, name: str) -> Path:
    """Return a path that does not exist yet: ``base/name``, or with a number appended."""
    for k in range(1, 100_000):
        path = base / (name if k == 1 else f"{name}-{k}")
        if not path.exists():
            return path
    raise OSError(f"{base} holds 100000 folders of the name {name}: clean it up")
