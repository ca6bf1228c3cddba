"""A Flyaround command in its own process: output to a file, polled, ended in bounded time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import new_path

PATIENCE_S = 8.0
"""Grace period before a program is killed."""
MOST_BYTES = 200_000
"""Largest number of output bytes that are read."""
FOLDER = Path("out") / "console"
"""Folder of files that the operator does not name."""


class ChildProgram:
    """``flyaround`` with arguments, in its own process.

    Parameters
    ----------
    arguments : sequence of str
        Command line after ``flyaround``.
    clock : callable, optional
        Monotonic time [s].

    Raises
    ------
    OSError
        If it cannot be started.
    """

    def __init__(self, arguments: Sequence[str], clock: Callable[[], float] = time.monotonic) -> None:
        self.arguments = tuple(arguments)
        self._clock = clock
        self._stopping_since_s: float | None = None
        # -P: a folder named hil in the working directory is not imported
        command = [sys.executable, "-P", "-m", "flyaround", *arguments]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        self._out, self._err = (tempfile.TemporaryFile() for _ in range(2))  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=self._out, stderr=self._err
        )

    @property
    def pid(self) -> int:
        """Process identifier."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True while it runs; if it does not end when asked, it is killed."""
        if self._process.poll() is not None:
            return False
        if self._stopping_since_s is not None and self._clock() - self._stopping_since_s > PATIENCE_S:
            self._process.kill()
        return True

    @property
    def exit_code(self) -> int | None:
        """Its exit code; None while it runs."""
        return self._process.poll()

    @property
    def stopped(self) -> bool:
        """True once it has been asked to end."""
        return self._stopping_since_s is not None

    def stop(self) -> None:
        """Interrupt it as Ctrl-C does; a second call kills it."""
        if self._process.poll() is not None:
            return
        with contextlib.suppress(OSError):
            self._process.send_signal(signal.SIGINT if self._stopping_since_s is None else signal.SIGKILL)
        self._stopping_since_s = self._stopping_since_s or self._clock()

    def output(self) -> str:
        """Return its standard output, truncated."""
        return _read(self._out.fileno())

    def last_error_line(self) -> str:
        """Return the last line on its error stream, without the program's name."""
        lines = [line.strip() for line in _read(self._err.fileno()).splitlines() if line.strip()]
        return lines[-1].removeprefix("flyaround: ") if lines else ""

    def close(self, patience_s: float = 2.0) -> None:
        """End it, waiting a little before it is killed."""
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


def output_file(named: str | None, name: str, suffix: str) -> Path:
    """Return the file that an operator named, or a new one in `FOLDER`.

    Raises
    ------
    UserError
        If the named file exists.
    """
    if named is None:
        return new_path(FOLDER, name, suffix)
    if Path(named).exists():
        raise UserError(f"{named} exists already; name another file")
    return Path(named)
