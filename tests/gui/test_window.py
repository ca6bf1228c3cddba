"""The console as an operator meets it: a window on a virtual screen, real keys, a real renderer."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.flight.recording import Recording
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from tests.harness.screen import SCREEN, xdotool
from tests.harness.sitting import Sitting, wait_until

pytestmark = [pytest.mark.gui, pytest.mark.timeout(1200)]


def is_saved(folder: Path) -> bool:
    """Whether the key P was heard, and what was pressed before it: a picture with its record is there."""
    return {path.suffix for path in (folder / "out" / "console").glob("*")} == {".json", ".png"}


def fly(display: str, folder: Path, operate: Callable[[Sitting], None]) -> tuple[dict[str, Any], np.ndarray]:
    """Run the console, operate it once its first picture is up, quit, and return its last state and last look."""
    options = "tango-flyaround", "--screenshot", "console.png", "--record", "flown"
    with Sitting(folder, *options, display=display) as sitting:
        sitting.wait_for("first picture")
        operate(sitting)
        sitting.keys("ctrl+q")
        state, _ = sitting.end()
    return state, cv2.cvtColor(cv2.imread(str(folder / "console.png")), cv2.COLOR_BGR2RGB)


def last_state(folder: Path) -> dict[str, np.ndarray] | None:
    """Return the newest sample of the flight that is being recorded, or None if there is none yet."""
    with contextlib.suppress(OSError, UserError):
        return {
            name: array[-1] for name, array in Recording.read(folder / "flown" / "flight.csv").arrays.items()
        }
    return None


def recorded_s(folder: Path) -> float:
    """Return the length of the flight that is being recorded [s]."""
    state = last_state(folder)
    return 0.0 if state is None else float(state["t_s"])


def closing_m_s(state: dict[str, np.ndarray] | None) -> float:
    """Return how fast the craft approach each other [m/s]."""
    if state is None:
        return 0.0
    r, v = state["relative_eci_m"], state["relative_eci_m_s"]
    return float(-r @ v / np.linalg.norm(r))


def target_right_m(state: dict[str, np.ndarray] | None) -> float:
    """Return the target's x in the camera [m]."""
    if state is None:
        return 0.0
    return float((matrix_from_quat(state["q_camera_from_eci_wxyz"]) @ -state["relative_eci_m"])[0])


def test_keys_fly_the_chaser_and_the_view_is_drawn(display: str, tmp_path: Path) -> None:
    def forward(_sitting: Sitting) -> None:
        xdotool(display, "key", "Insert", "keydown", "w")
        wait_until(lambda: closing_m_s(last_state(tmp_path)) > 0.1)
        xdotool(display, "keyup", "w", "key", "p")
        wait_until(lambda: is_saved(tmp_path))

    state, image = fly(display, tmp_path, forward)
    assert state["mode"] == "steer"
    # guidance alone would recede at this time; seconds of thrust close in
    assert state["closing_m_s"] > 0.05
    assert state["t_s"] > 0
    assert state["pictures"] >= 3
    assert image.shape == (SCREEN[1], SCREEN[0], 3)
    view, panel = image[200:600, 100:850], image[:, 960:]
    assert view.std() > 8.0, "the view shows nothing"
    assert 10.0 < panel.mean() < 100.0, "the panel is missing"
    record, png = sorted((tmp_path / "out" / "console").iterdir())
    truth = json.loads(record.read_text())
    picture = cv2.imread(str(png), cv2.IMREAD_UNCHANGED)
    assert picture.shape[:2] == (truth["camera"]["height_px"], truth["camera"]["width_px"])


def test_turning_right_moves_the_target_left_and_pause_freezes(display: str, tmp_path: Path) -> None:
    def turn_and_pause(_sitting: Sitting) -> None:
        xdotool(display, "key", "Insert", "keydown", "l")
        wait_until(lambda: target_right_m(last_state(tmp_path)) < -0.2)
        xdotool(display, "keyup", "l", "key", "space", "key", "p")
        wait_until(lambda: is_saved(tmp_path))
        # its field takes the letters from here on
        xdotool(display, "key", "F1")

    state, image = fly(display, tmp_path, turn_and_pause)
    assert state["paused"]
    assert state["tracking"]
    assert state["t_camera_from_target_m"][0] < -0.1
    assert abs(state["t_camera_from_target_m"][1]) < 0.1
    # the list of keys lies over the middle of the view
    assert image[300:500, 500:700].mean() < 60.0


def drawing_process(console: int) -> int:
    """Number of the process that draws for a console."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
            if parent == console and b"spawn_main" in (stat.parent / "cmdline").read_bytes():
                return int(stat.parent.name)
    pytest.fail("the console has no drawing process")


def test_a_killed_console_leaves_its_flight(display: str, tmp_path: Path) -> None:
    with Sitting(tmp_path, "tango-flyaround", "--record", "flown", display=display) as sitting:
        sitting.wait_for("first picture")
        xdotool(display, "key", "Insert", "keydown", "w")
        wait_until(lambda: closing_m_s(last_state(tmp_path)) > 0.02)
        drawing = drawing_process(sitting.process.pid)
        sitting.process.kill()
        xdotool(display, "keyup", "w")
    flown = Recording.read(tmp_path / "flown" / "flight.csv")
    assert flown.duration_s > 0.5
    # all but the last second is replayed, by an ordinary scenario
    replay = load_scenario(tmp_path / "flown" / "replay.toml")
    assert flown.duration_s - 2.0 < replay.duration_s <= flown.duration_s
    flight = plan_flight(replay, n=1).flight
    last = flight.state(replay.duration_s)
    assert np.linalg.norm(last.velocity_lvlh_m_s) > 0.01
    # who draws ends by itself
    wait_until(lambda: not Path(f"/proc/{drawing}").exists())


@pytest.mark.slow
def test_a_drawing_process_that_dies_is_started_again(display: str, tmp_path: Path) -> None:
    with Sitting(tmp_path, "tango-flyaround", "--record", "flown", display=display) as sitting:
        sitting.wait_for("first picture")
        died_s = recorded_s(tmp_path)
        os.kill(drawing_process(sitting.process.pid), signal.SIGABRT)
        assert "exit code -6" in sitting.wait_for("died")
        sitting.command("picture.save", "saved")
        state, _ = sitting.quit()
    assert state["drawing_restarts"] == 1
    # one before it died, and the saved one
    assert state["pictures"] >= 2
    # it was recorded all along
    assert load_scenario(tmp_path / state["replay"]).duration_s == pytest.approx(state["t_s"], abs=0.3)
    assert state["t_s"] > died_s


def test_without_a_display_one_sentence_says_what_to_do(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    done = subprocess.run(
        [sys.executable, "-m", "flyaround", "sim", "--seconds", "1"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2
    assert "xvfb-run" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
