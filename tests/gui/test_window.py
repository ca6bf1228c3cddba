"""The console as an operator meets it: a window on a virtual screen, real keys, a real renderer."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
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

pytestmark = pytest.mark.gui

START_TIMEOUT_S = 120.0


def wait_until(done: Callable[[], bool]) -> None:
    until = time.monotonic() + START_TIMEOUT_S
    while not done():
        assert time.monotonic() < until, "it did not come"
        time.sleep(0.1)


def is_saved(folder: Path) -> bool:
    """Whether the key P was heard, and what was pressed before it: a picture with its record is there."""
    return {path.suffix for path in (folder / "out" / "console").glob("*")} == {".json", ".png"}


def fly(display: str, folder: Path, operate: Callable[[], None]) -> tuple[dict[str, Any], np.ndarray]:
    """Run the console, operate it once its first picture is up, quit, and return its last state and last look."""
    screenshot = folder / "console.png"
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-flyaround", "--json"]
    command += ["--seconds", str(START_TIMEOUT_S), "--screenshot", str(screenshot), "--record", "flown"]
    environment = {**os.environ, "DISPLAY": display, "FLYAROUND_CONSOLE_LAYOUT": str(folder / "layout.json")}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stdout is not None
        assert console.stderr is not None
        lines: list[str] = []
        for line in console.stderr:
            lines.append(line)
            if "first picture" in line:
                break
        else:
            pytest.fail(f"no picture came: {''.join(lines)}")
        operate()
        xdotool(display, "key", "ctrl+q")
        out, err = console.communicate(timeout=2 * START_TIMEOUT_S)
    assert console.returncode == 0, err
    return json.loads(out), cv2.cvtColor(cv2.imread(str(screenshot)), cv2.COLOR_BGR2RGB)


def last_state(folder: Path) -> dict[str, np.ndarray] | None:
    """Return the newest sample of the flight that is being recorded, or None if there is none yet."""
    with contextlib.suppress(OSError, UserError):
        return {
            name: array[-1] for name, array in Recording.read(folder / "flown" / "flight.csv").arrays.items()
        }
    return None


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
    def forward() -> None:
        xdotool(display, "key", "Insert", "keydown", "w")
        wait_until(lambda: closing_m_s(last_state(tmp_path)) > 0.1)
        xdotool(display, "keyup", "w", "key", "p")
        wait_until(lambda: is_saved(tmp_path))

    state, image = fly(display, tmp_path, forward)
    assert state["mode"] == "steer"
    # guidance alone would recede at this time; seconds of thrust close in
    assert state["closing_m_s"] > 0.05
    assert 0 < state["t_s"] < START_TIMEOUT_S
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
    def turn_and_pause() -> None:
        xdotool(display, "key", "Insert", "keydown", "l")
        wait_until(lambda: target_right_m(last_state(tmp_path)) < -0.2)
        xdotool(display, "keyup", "l", "key", "space", "key", "F1", "key", "p")
        wait_until(lambda: is_saved(tmp_path))

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
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-flyaround", "--record", "flown"]
    environment = {
        **os.environ,
        "DISPLAY": display,
        "FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "layout.json"),
    }
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stderr is not None
        assert any("first picture" in line for line in console.stderr), "no picture came"
        xdotool(display, "key", "Insert", "keydown", "w")
        wait_until(lambda: closing_m_s(last_state(tmp_path)) > 0.02)
        drawing = drawing_process(console.pid)
        console.kill()
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
    until = time.monotonic() + START_TIMEOUT_S
    while Path(f"/proc/{drawing}/cmdline").exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not Path(f"/proc/{drawing}").exists()


@pytest.mark.slow
def test_a_drawing_process_that_dies_is_started_again(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-flyaround", "--off-screen", "--json"]
    command += ["--seconds", "40", "--record", "flown"]
    environment = {
        **os.environ,
        "FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "layout.json"),
        "COLUMNS": "400",
    }
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stderr is not None
        assert any("first picture" in line for line in console.stderr), "no picture came"
        os.kill(drawing_process(console.pid), signal.SIGABRT)
        told = next((line for line in console.stderr if "died" in line), "")
        out, err = console.communicate(timeout=2 * START_TIMEOUT_S)
    assert console.returncode == 0, err
    assert "exit code -6" in told
    assert "Traceback" not in err
    assert "leaked" not in err
    state = json.loads(out)
    assert state["drawing_restarts"] == 1
    # at most two before it died
    assert state["pictures"] >= 3
    replay = load_scenario(tmp_path / state["replay"])
    # it was recorded all along
    assert replay.duration_s > 15.0


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
