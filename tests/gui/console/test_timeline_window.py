"""The timeline's buttons in a real window, by the mouse: a data set and a session of what was flown."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.gui.console.test_windows import Sitting
from tests.harness.screen import xdotool

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1200)]

SCRIPT = """\
0.1 picture.detail quarter
0.2 panel.timeline on
0.5 hold steer.left
1.5 release steer.left
3 time.pause
5 window.screenshot ready.png
20 panel.capture off
22 window.screenshot again.png
40 hil.start tcp://127.0.0.1:0
41 hil.board hybrid
100 hil.stop
150 window.close
"""
"""The clock stands while a scenario is opened."""
DATA_SET, HIL_RUN = ("498", "640"), ("586", "640")
"""Where the buttons are in the first layout of a window of 1280 x 800."""


def click(display: str, place: tuple[str, str]) -> None:
    xdotool(display, "mousemove", *place)
    time.sleep(1.0)
    xdotool(display, "click", "1")


def flyaround(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "flyaround", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_data_set_and_a_session_are_made_of_what_was_flown(display: str, tmp_path: Path) -> None:
    sitting = Sitting(display, tmp_path, SCRIPT, "tango-vbar-closed-loop")
    try:
        sitting.wait_for("ready.png")
        click(display, DATA_SET)
        # closed, the panel of the capture leaves the timeline where it was
        sitting.wait_for("again.png")
        click(display, HIL_RUN)
        state, said = sitting.end()
    finally:
        sitting.process.kill()
    assert "captured: 50 frames" in said
    assert "board connected" in said
    assert state["scenario"].startswith("tango-vbar")
    (data_set,) = (tmp_path / "out/console").glob("set-*")
    flyaround(tmp_path, "check", str(data_set))
    (ledger,) = (tmp_path / "out/console").glob("hil-*")
    summary = json.loads((ledger / "summary.json").read_text())
    assert summary["sent"] > 0
    rows = (ledger / "frames.csv").read_text().splitlines()
    assert rows[0].startswith("frame_id")
    assert len(rows) == summary["sent"] + 1
    flyaround(tmp_path, "hil", "report", str(ledger))
