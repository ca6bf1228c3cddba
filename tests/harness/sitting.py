"""The console in a process of its own, off screen or in a window of a virtual screen; every wait is for an event."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

from tests.harness.screen import xdotool

LONGEST_S = 900.0
"""Longest wait, for machines many times slower than any that is known."""


def wait_until(done: Callable[[], object]) -> None:
    """Wait until a function returns true."""
    until = time.monotonic() + LONGEST_S
    while not done():
        assert time.monotonic() < until, "it did not come"
        time.sleep(0.1)


class Sitting:
    """A console that is operated by a script, or by keys in a window; killed at the end of a ``with`` block.

    Parameters
    ----------
    folder : its working directory, which also holds its layout.
    options : of `flyaround sim`, after the scenario.
    script : text of a script; empty for none.
    display : name of the X display; empty for off screen.
    """

    def __init__(self, folder: Path, *options: str, script: str = "", display: str = "") -> None:
        command = [sys.executable, "-m", "flyaround", "-v", "sim", "--json", *options]
        if script:
            (folder / "script").write_text(script)
            command += ["--script", "script"]
        if not display:
            command.append("--off-screen")
        self.layout = folder / "layout.json"
        environment = os.environ | {
            "DISPLAY": display,
            "FLYAROUND_CONSOLE_LAYOUT": str(self.layout),
            "COLUMNS": "400",
        }
        self._display = display
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._lines: list[str] = []
        self._read = 0
        self._reader = threading.Thread(target=self._listen, daemon=True)
        self._reader.start()

    def _listen(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._lines.append(line)

    @property
    def heard(self) -> str:
        """All that the console has said."""
        return "".join(self._lines)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        for pipe in (self.process.stdout, self.process.stderr):
            if pipe is not None:
                pipe.close()

    def wait_for(
        self, *words: str, meanwhile: Callable[[], None] = lambda: None, every_s: float = 4.0
    ) -> str:
        """Wait until the console says a line with one of these words, after those that were waited for before.

        Parameters
        ----------
        meanwhile : called at intervals until then.
        """
        until = time.monotonic() + LONGEST_S
        due = time.monotonic() + every_s
        while time.monotonic() < until:
            ended = not self._reader.is_alive()
            while self._read < len(self._lines):
                line, self._read = self._lines[self._read], self._read + 1
                if any(word in line for word in words):
                    return line
            if ended:
                break
            if time.monotonic() > due:
                meanwhile()
                due = time.monotonic() + every_s
            time.sleep(0.05)
        pytest.fail(f"the console never said '{' or '.join(words)}':\n{self.heard[-3000:]}")

    def keys(self, *keys: str) -> None:
        """Press keys, one after the other."""
        xdotool(self._display, *(word for key in keys for word in ("key", key)))

    def command(self, line: str, *words: str) -> None:
        """Type a command into the palette; wait until the console says one of some words, if any."""
        self.keys("ctrl+p")
        xdotool(self._display, "type", "--delay", "5", line)
        self.keys("Return")
        if words:
            self.wait_for(*words)

    def end(self) -> tuple[dict[str, Any], str]:
        """Wait for the end; return the console's last state, and all that it said."""
        assert self.process.stdout is not None
        # its last state is short: the pipe holds it
        self.process.wait(LONGEST_S)
        self._reader.join()
        assert self.process.returncode == 0, self.heard
        assert "Traceback" not in self.heard
        assert "leaked" not in self.heard
        return json.loads(self.process.stdout.read()), self.heard

    def quit(self) -> tuple[dict[str, Any], str]:
        """Quit by the palette, without a question; return as `end`."""
        self.command("window.close")
        return self.end()
