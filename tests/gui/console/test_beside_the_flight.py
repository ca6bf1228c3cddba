"""Estimator, board and capture in a real window, by a script: what an operator sees goes on while they work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from flyaround.simulator.dataset.card import read_card

pytestmark = [pytest.mark.gui, pytest.mark.slow]

SCRIPT = """\
0.1 picture.detail quarter
0.2 panel.estimator on
0.2 panel.board-link on
0.2 panel.capture on
0.3 estimator.stages on
0.3 estimator.run on
0.4 capture.start 3 tango-space-10m data-set
0.5 hil.start tcp://127.0.0.1:0
0.6 hil.board hybrid
35 hil.fault gain_step 5
50 hil.stop
52 capture.start 5 no-such-recipe
70 window.close
"""


def test_they_work_beside_the_flight(display: str, tmp_path: Path) -> None:
    (tmp_path / "s.script").write_text(SCRIPT)
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-space-10m", "--json"]
    command += ["--script", "s.script", "--screenshot", "look.png"]
    environment = {
        **os.environ,
        "DISPLAY": display,
        "FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "layout.json"),
    }
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=900
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "leaked" not in done.stderr
    state = json.loads(done.stdout)
    assert state["operator_s"] >= 70
    # a data set that is whole, a ledger, and a mistake that was told
    assert read_card(tmp_path / "data-set").n_frames == 3
    assert "captured: 3 frames" in done.stderr
    assert "no-such-recipe" in done.stderr
    summary = json.loads((tmp_path / "out/console/hil-tango-space-10m/summary.json").read_text())
    assert summary["sent"] > 0
    assert "board connected" in done.stderr
    assert cv2.imread(str(tmp_path / "look.png")).std() > 5
