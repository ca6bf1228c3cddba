"""The timeline's buttons: what was flown becomes a scenario, and that a data set or the flight of a session."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.jobs.capture_job import CaptureRequest
from flyaround.gui.panels.timeline import TimelinePanel
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

pytest.importorskip("imgui_bundle", reason="the gui extra is not installed")

WAIT_S = 300.0


@pytest.fixture
def console(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    """A flight that was steered for two seconds."""
    monkeypatch.chdir(tmp_path)
    console = console_flying("tango-vbar-closed-loop")
    console.hand.armed = True
    for k in range(40):
        console.pass_time(50, frozenset({"steer.left"} if k < 20 else ()))
    console.do("time.pause")
    yield console
    console.close()


def turn_until(console: Console, done: Callable[[], bool]) -> None:
    """Let the console's loop turn; the flight is paused."""
    until = time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < until, console.messages
        console.pass_time(10)
        time.sleep(2e-3)


def press(console: Console, label: str) -> None:
    window = HeadlessWindow()
    try:
        panel = TimelinePanel(window)  # type: ignore[arg-type]
        window.press(label, lambda: panel.draw(console))
    finally:
        window.close()


def test_the_button_of_a_hil_run_flies_what_was_flown(console: Console) -> None:
    flown = console.session
    press(console, "HIL run")
    turn_until(console, lambda: console.session is not flown)
    replayed = console.session
    assert console.source == "out/console/flights/tango-vbar-closed-loop-001/replay.toml"
    assert console.shown["board-link"]
    # the free drift alone is warned of
    assert [m.text for m in console.messages if m.level != "note" and "free drift" not in m.text] == []
    # a board waits for pictures: the same flight goes on by itself, where it was kept
    turn_until(console, lambda: replayed.t_s >= 1.5)
    assert replayed.look_back.seek(1.5) == pytest.approx(1.5, abs=0.1)
    at = replayed.craft.world
    flown.look_back.seek(at.t_s)
    assert np.linalg.norm(at.velocity_lvlh_m_s) > 0.01
    assert at.position_lvlh_m == pytest.approx(flown.craft.world.position_lvlh_m, abs=1e-5)


def test_the_button_of_a_data_set_captures_what_was_flown(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[CaptureRequest] = []
    monkeypatch.setattr(console.jobs.capture, "start", asked.append)
    press(console, "Data set")
    turn_until(console, lambda: bool(asked))
    assert (asked[0].frames, asked[0].what) == (
        50,
        "out/console/flights/tango-vbar-closed-loop-001/replay.toml",
    )
    assert console.shown["capture"]
    replay = load_scenario(asked[0].what)
    assert replay.duration_s == pytest.approx(console.session.t_s, abs=0.11)
    last = plan_flight(replay, n=1).flight.state(replay.duration_s)
    assert last.velocity_lvlh_m_s == pytest.approx(console.session.craft.world.velocity_lvlh_m_s, abs=1e-3)
    # again: a folder of its own
    press(console, "Data set")
    turn_until(console, lambda: len(asked) == 2)
    assert "loop-002" in asked[1].what


def test_the_capture_panel_takes_what_was_flown_as_it_is_seen(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[CaptureRequest] = []
    monkeypatch.setattr(console.jobs.capture, "start", asked.append)
    flown = console.session.plan.scenario
    console.do("camera.use", "fisheye-140")
    console.do("picture.exposure", 1.0)
    console.do("light.add", "lamp")
    console.do("sensor.set", "gaussian_variance", 0.003)
    console.do("capture.start", 7, "what-i-flew", "mine", "coco", 2)
    turn_until(console, lambda: bool(asked))
    request = asked[0]
    assert (request.frames, str(request.folder), request.formats, request.workers) == (7, "mine", "coco", 2)
    plan = plan_flight(load_scenario(request.what), n=1)
    scene = plan.scene_of(plan.flight.state(0.0), 0)
    assert scene.camera == load_camera("fisheye-140")
    assert scene.exposure_s == pytest.approx(2 * flown.sensor.exposure_s)
    assert scene.lamp is not None
    assert scene.sensor.gaussian_variance == 0.003
    # a kept flight has the scenario's own
    console.do("timeline.keep", "kept")
    turn_until(console, lambda: not console.jobs.keeping)
    assert load_scenario("kept/replay.toml").camera == flown.camera
    # refused before a file is written
    (Path("mine") / "x").mkdir(parents=True)
    before = sorted(Path("out").rglob("*"))
    for what in ("what-i-flew", "this-flight"):
        console.do("capture.start", 7, what, "mine")
        assert "is not empty" in console.messages[-1].text
    assert sorted(Path("out").rglob("*")) == before
    assert not console.jobs.keeping


@pytest.mark.slow
def test_the_data_set_of_what_was_flown_is_right(console: Console, tmp_path: Path) -> None:
    console.do("timeline.dataset", 4)
    turn_until(console, lambda: bool(console.jobs.capture.outcome))
    assert console.jobs.capture.outcome.startswith("captured"), console.jobs.capture.outcome
    assert console.jobs.capture.request is not None
    done = subprocess.run(
        [sys.executable, "-m", "flyaround", "check", str(console.jobs.capture.request.folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(list((tmp_path / console.jobs.capture.request.folder / "images").glob("*.png"))) >= 4
