"""Estimator, board and capture in a real window: what an operator sees goes on while they work."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest

from flyaround.simulator.dataset.card import read_card
from tests.harness.sitting import Sitting, wait_until

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]

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
"""


def test_they_work_beside_the_flight(display: str, tmp_path: Path) -> None:
    ledger = tmp_path / "out/console/hil-tango-space-10m"

    def answered() -> bool:
        frames = ledger / "frames.csv"
        return frames.is_file() and len(frames.read_text().splitlines()) > 2

    with Sitting(
        tmp_path, "tango-space-10m", "--screenshot", "look.png", script=SCRIPT, display=display
    ) as sitting:
        wanted = {"board connected", "captured: 3 frames", "first accepted pose"}
        while wanted:
            line = sitting.wait_for(*wanted)
            wanted = {word for word in wanted if word not in line}
        wait_until(answered)
        sitting.command("hil.fault gain_step 5")
        sitting.command("hil.stop", "the session with the board ended")
        # a mistake is reported
        sitting.command("capture.start 5 no-such-recipe", "the capture failed")
        state, said = sitting.quit()
    assert "no-such-recipe" in said
    assert state["t_s"] > 1.0
    assert read_card(tmp_path / "data-set").n_frames == 3
    assert json.loads((ledger / "summary.json").read_text())["sent"] > 0
    assert cv2.imread(str(tmp_path / "look.png")).std() > 5
