"""A new user at the console: a fresh profile, no argument, keys and nothing else.

Within a minute of the window the craft is flown around with the estimator's pose over it, within ten it is docked with.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import ImageGrab

from tests.harness.screen import virtual_screen, xdotool

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1500)]

ESTIMATE_WITHIN_S, DOCKED_WITHIN_S = 60.0, 600.0
KEEP = os.environ.get("FLYAROUND_TEST_PICTURES", "")
"""Folder for looks of the window, if one is named."""


class Operator:
    """Presses keys, reads what the console says, and prints both with the time since the window's first picture."""

    def __init__(self, display: str, console: subprocess.Popen[str]) -> None:
        self.display = display
        self.lines: list[tuple[float, str]] = []
        self._console = console
        self._start_s = time.monotonic()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._console.stderr is not None
        for line in iter(self._console.stderr.readline, ""):
            self.lines.append((time.monotonic(), line.strip()))

    def began(self) -> None:
        """Count time from now."""
        self._start_s = time.monotonic()

    @property
    def seconds(self) -> float:
        """Since the first picture."""
        return time.monotonic() - self._start_s

    def tell(self, what: str) -> None:
        """Print a time stamp."""
        sys.stdout.write(f"{self.seconds:7.1f} s  {what}\n")

    def keys(self, *keys: str) -> None:
        """Press keys, one after the other."""
        self.tell(f"keys {' '.join(keys)}")
        for key in keys:
            xdotool(self.display, "key", key)
            time.sleep(0.15)

    def command(self, words: str) -> None:
        """A command by the palette."""
        self.keys("ctrl+p")
        time.sleep(1.0)
        self.look(f"new-user-{words.split(maxsplit=1)[0]}")
        self.tell(f"types {words}")
        xdotool(self.display, "type", "--delay", "40", words)
        time.sleep(0.8)
        self.keys("Return")
        time.sleep(0.5)

    def heard(self, words: str) -> str | None:
        """What the console said with these words in it."""
        return next((line for _, line in self.lines if words in line), None)

    def wait(self, words: str, until_s: float, press: tuple[str, ...] = (), every_s: float = 4.0) -> str:
        """Until the console says it, pressing keys again and again meanwhile."""
        pressed = self.seconds
        while (line := self.heard(words)) is None:
            if self._console.poll() is not None or self.seconds > until_s:
                self.look("new-user-failed")
                told = "\n".join(line for _, line in self.lines[-15:])
                pytest.fail(f"the console did not say '{words}' within {until_s:.0f} s:\n{told}")
            if press and self.seconds - pressed > every_s:
                self.keys(*press)
                pressed = self.seconds
            time.sleep(0.2)
        self.tell(line)
        return line

    def look(self, name: str) -> np.ndarray:
        """What is on the screen."""
        image = ImageGrab.grab(xdisplay=self.display)
        if KEEP:
            image.save(Path(KEEP) / f"{name}.png")
        return np.asarray(image)


def test_from_a_fresh_profile_to_a_docked_craft(tmp_path: Path) -> None:
    with virtual_screen() as display:
        environment = {
            **os.environ,
            "DISPLAY": display,
            "FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "profile" / "console.json"),
        }
        command = [sys.executable, "-m", "flyaround", "-v", "sim", "--json"]
        with subprocess.Popen(
            command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as console:
            try:
                state = fly(Operator(display, console), console)
            finally:
                console.kill()
                console.wait()
    assert state["docking"] is not None
    assert state["docking"]["docked"]
    assert state["docking"]["score"] > 50
    assert (tmp_path / "profile" / "console.json").is_file()


def fly(operator: Operator, console: subprocess.Popen[str]) -> dict[str, object]:
    """All that the user does; the console's last state."""
    operator.wait("first picture", 120.0)
    operator.began()
    operator.command("help.tour-end")
    # the estimator is given what is on the screen
    operator.command("picture.detail full")
    operator.command("estimator.run on")
    operator.wait("first accepted pose", ESTIMATE_WITHIN_S)
    operator.look("new-user-estimate")
    operator.command("panel.docking on")
    operator.keys("Insert", "b")
    operator.wait("the autopilot flies", operator.seconds + 20.0)
    operator.keys("plus", "plus")
    # go at each hold point, refused until the chaser rests there
    operator.wait("docked at", DOCKED_WITHIN_S, press=("Return",))
    assert operator.seconds < DOCKED_WITHIN_S
    picture = operator.look("new-user-docked")
    assert picture.std() > 8.0
    operator.keys("ctrl+q", "ctrl+q")
    assert console.stdout is not None
    out = console.stdout.read()
    assert console.wait(timeout=60) == 0
    return dict(json.loads(out))
