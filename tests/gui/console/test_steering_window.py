"""Steering and docking in a real window, by the mouse and keys of a virtual screen; what was done is in the log."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.harness.screen import xdotool
from tests.harness.sitting import Sitting, wait_until

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]

EXAMPLES = Path(__file__).parents[3] / "examples"
SHORT_S = 1.0
"""Between two movements of a hand, of which a window must have drawn the first to act on the second."""


class Log:
    """The commands that a console has done, as it writes them to its log."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def done(self) -> list[str]:
        """Commands with their arguments.

        Keys that are held are left out: Ctrl is one by itself where a picture is drawn between Ctrl and Q.
        """
        if not self._path.is_file():
            return []
        whole = self._path.read_text().rpartition("\n")[0]
        lines = [line.partition(" ")[2] for line in whole.splitlines() if not line.startswith("#")]
        return [line for line in lines if not line.startswith(("hold ", "release "))]

    def wait_for(self, done: Callable[[list[str]], object]) -> None:
        """Wait until a function of the commands is true."""
        wait_until(lambda: done(self.done))


def operated(
    display: str, folder: Path, operate: Callable[[Sitting, Log], None]
) -> tuple[dict[str, Any], list[str]]:
    """Last state and commands done, of a console that is operated and then closed by its key."""
    log = Log(folder / "log.script")
    options = str(EXAMPLES / "docking.toml"), "--log", "log.script", "--screenshot", "console.png"
    with Sitting(folder, *options, display=display) as sitting:
        sitting.wait_for("first picture")
        operate(sitting, log)
        # asked twice, because the flight is not kept
        sitting.keys("ctrl+q", "ctrl+q")
        state, _ = sitting.end()
    return state, log.done


def numbers(line: str) -> list[float]:
    """Return the arguments of a command."""
    return [float(word) for word in line.split()[1:]]


def newest(done: list[str], name: str) -> list[float]:
    """Return the arguments of the newest command of a name; zeros if there is none."""
    return next((numbers(line) for line in reversed(done) if line.startswith(name)), [0.0, 0.0, 0.0])


def test_the_mouse_steers_over_the_view(display: str, tmp_path: Path) -> None:
    def at(x: int, y: int) -> None:
        # in two steps, as a hand does
        xdotool(display, "mousemove", str(x - 1), str(y), "mousemove", str(x), str(y))

    def by_mouse(sitting: Sitting, log: Log) -> None:
        sitting.keys("Insert")
        log.wait_for(lambda done: "steer.arm" in done)
        at(450, 400)
        time.sleep(SHORT_S)
        xdotool(display, "mousedown", "1")
        time.sleep(SHORT_S)
        at(520, 400)
        # right, and then still again
        log.wait_for(lambda done: newest(done, "steer.stick-turn")[1] > 0.3)
        xdotool(display, "mouseup", "1")
        log.wait_for(lambda done: not any(newest(done, "steer.stick-turn")))
        xdotool(display, "click", "4")
        log.wait_for(lambda done: "steer.pulse forward" in done)
        xdotool(display, "mousedown", "3")
        time.sleep(SHORT_S)
        at(520, 330)
        # up, and then none
        log.wait_for(lambda done: newest(done, "steer.stick-thrust")[1] < -0.3)
        xdotool(display, "mouseup", "3")
        log.wait_for(lambda done: not any(newest(done, "steer.stick-thrust")))

    state, _ = operated(display, tmp_path, by_mouse)
    assert state["mode"] == "steer"
    assert state["delta_v_m_s"] > 0.01


def test_keys_engage_the_autopilot_and_abort(display: str, tmp_path: Path) -> None:
    keys = {
        "Insert": "steer.arm",
        "b": "docking.approach",
        "n": "steer.lvlh",
        "m": "steer.pulses",
        "Return": "docking.go",
        "Delete": "docking.abort",
    }

    def by_keys(sitting: Sitting, log: Log) -> None:
        for k, key in enumerate(keys, 1):
            sitting.keys(key)
            log.wait_for(lambda done, k=k: len(done) == k)

    state, done = operated(display, tmp_path, by_keys)
    assert done == [*keys.values(), "window.quit", "window.quit", "window.close"]
    assert state["mode"] == "steer"
    assert state["delta_v_m_s"] > 0.0
    assert state["docking"] is None
