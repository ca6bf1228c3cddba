"""Steering and docking in a real window, by the mouse and keys of a virtual screen; what was done is in the log."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flyaround.gui.app import command_table
from flyaround.gui.script import Script
from tests.harness.screen import xdotool

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(600)]

EXAMPLES = Path(__file__).parents[3] / "examples"
TIMEOUT_S = 300.0
SHORT_S, LONG_S = 1.0, 2.5
"""Between two things that the operator does; a busy machine draws the window twice a second."""


def operated(
    display: str, folder: Path, operate: Callable[[], None], *more: str
) -> tuple[dict[str, Any], list[str]]:
    """Last state and commands done, of a console that is operated and then closed by its key.

    Keys that are held are left out: Ctrl is one by itself where a picture is drawn between Ctrl and Q.
    """
    log = folder / "log.script"
    command = [sys.executable, "-m", "flyaround", "-v", "sim", str(EXAMPLES / "docking.toml"), "--json"]
    command += ["--log", str(log), "--screenshot", str(folder / "console.png"), *more]
    environment = {**os.environ, "DISPLAY": display, "FLYAROUND_CONSOLE_LAYOUT": str(folder / "layout.json")}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stdout is not None
        assert console.stderr is not None
        lines = []
        for line in console.stderr:
            lines.append(line)
            if "first picture" in line:
                break
        else:
            pytest.fail(f"no picture came: {''.join(lines)}")
        time.sleep(LONG_S)
        operate()
        out, err = console.communicate(timeout=TIMEOUT_S)
    assert console.returncode == 0, err
    done = Script.read(log, command_table()).lines
    return json.loads(out), [str(line).partition(" ")[2] for line in done if line.verb == "do"]


def at(display: str, x: int, y: int) -> None:
    """Move the pointer in two steps, as a hand does."""
    xdotool(display, "mousemove", str(x - 1), str(y), "mousemove", str(x), str(y))
    time.sleep(SHORT_S)


def test_the_mouse_steers_over_the_view(display: str, tmp_path: Path) -> None:
    def by_mouse() -> None:
        xdotool(display, "key", "Insert")
        time.sleep(SHORT_S)
        at(display, 450, 400)
        xdotool(display, "mousedown", "1")
        time.sleep(SHORT_S)
        at(display, 520, 400)
        xdotool(display, "mouseup", "1")
        time.sleep(SHORT_S)
        xdotool(display, "click", "4")
        time.sleep(SHORT_S)
        xdotool(display, "mousedown", "3")
        time.sleep(SHORT_S)
        at(display, 520, 330)
        xdotool(display, "mouseup", "3")
        time.sleep(LONG_S)
        xdotool(display, "key", "ctrl+q", "ctrl+q")

    state, done = operated(display, tmp_path, by_mouse)
    turns = [line.split() for line in done if line.startswith("steer.stick-turn")]
    pushes = [line.split() for line in done if line.startswith("steer.stick-thrust")]
    # right, and then still again
    assert float(turns[-2][2]) > 0.3
    assert [float(x) for x in turns[-1][1:]] == [0.0, 0.0, 0.0]
    # up, and then none
    assert float(pushes[-2][2]) < -0.3
    assert [float(x) for x in pushes[-1][1:]] == [0.0, 0.0, 0.0]
    assert "steer.pulse forward" in done
    assert state["mode"] == "steer"
    assert state["delta_v_m_s"] > 0.01


def test_keys_engage_the_autopilot_and_abort(display: str, tmp_path: Path) -> None:
    def by_keys() -> None:
        for key in ("Insert", "b", "n", "m", "Return", "Delete", "ctrl+q", "ctrl+q"):
            xdotool(display, "key", key)
            time.sleep(LONG_S)

    state, done = operated(display, tmp_path, by_keys)
    assert done == [
        "steer.arm",
        "docking.approach",
        "steer.lvlh",
        "steer.pulses",
        "docking.go",
        "docking.abort",
        "window.quit",
        "window.quit",
        "window.close",
    ]
    assert state["mode"] == "steer"
    assert state["delta_v_m_s"] > 0.0
    assert state["docking"] is None
