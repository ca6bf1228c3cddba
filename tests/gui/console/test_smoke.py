"""The console in half a minute, off screen: a script through its commands, the timeline, a picture of all of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from tests.harness.screen import SCREEN

SCRIPT = """\
0.2 hold steer.forward
0.4 panel.timeline on
0.8 release steer.forward
1.0 timeline.bookmark "thrust ends"
1.2 overlay.keypoints on
1.4 settings.undo
1.6 help.panel timeline
1.8 panel.help off
2.0 timeline.seek 0.5
2.2 timeline.fly-on
2.4 film.start view.mp4
3.6 film.stop
3.8 panel.log on
4.0 window.screenshot look.png
4.4 window.close
"""


@pytest.mark.gui
def test_a_script_goes_through_the_console(tmp_path: Path) -> None:
    (tmp_path / "script").write_text(SCRIPT)
    command = [sys.executable, "-m", "flyaround", "sim", "tango-flyaround", "--json"]
    command += ["--off-screen", "--script", "script"]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "layout.json")},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    state = json.loads(done.stdout)
    assert state["mode"] == "steer"
    assert state["pictures"] > 0
    # 0.6 s of thrust, of which the part after 0.5 s of the flight was left
    assert 0.0 < state["delta_v_m_s"] < 0.03
    look = cv2.imread(str(tmp_path / "look.png"))
    assert look.shape == (SCREEN[1], SCREEN[0], 3)
    assert look[200:500, 100:800].std() > 8.0
    assert (tmp_path / "view.mp4").stat().st_size > 0
    assert json.loads((tmp_path / "layout.json").read_text())["shown"]["timeline"]
