"""A recorded flight becomes a data set and a session with a board, by keys in a real window."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.harness.sitting import LONGEST_S, Sitting, wait_until

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]

SCRIPT = """\
0.1 picture.detail quarter
0.5 hold steer.left
1.5 release steer.left
3 time.pause
"""


def flyaround(folder: Path, *arguments: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "flyaround", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_data_set_and_a_session_are_made_of_what_was_flown(display: str, tmp_path: Path) -> None:
    out = tmp_path / "out/console"
    with Sitting(tmp_path, "tango-vbar-closed-loop", script=SCRIPT, display=display) as sitting:
        sitting.wait_for("first picture")
        sitting.command("timeline.dataset", "captured: 50 frames")
        sitting.command("timeline.hil", "now: ")
        sitting.command("hil.start tcp://127.0.0.1:0", "a board may connect")
        sitting.command("hil.board hybrid", "board connected")
        wait_until(lambda: any(len(p.read_text().splitlines()) > 2 for p in out.glob("hil-*/frames.csv")))
        sitting.command("hil.stop", "the session with the board ended")
        state, _ = sitting.quit()
    assert state["scenario"].startswith("tango-vbar")
    (data_set,) = out.glob("set-*")
    flyaround(tmp_path, "check", str(data_set))
    (ledger,) = out.glob("hil-*")
    summary = json.loads((ledger / "summary.json").read_text())
    assert summary["sent"] > 0
    rows = (ledger / "frames.csv").read_text().splitlines()
    assert rows[0].startswith("frame_id")
    assert len(rows) == summary["sent"] + 1
    flyaround(tmp_path, "hil", "report", str(ledger))
