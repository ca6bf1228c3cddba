"""What is on screen as a command line, run."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flyaround.gui.app import options_of
from flyaround.gui.picture.command_line import command_lines
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario

pytestmark = pytest.mark.gl


def test_the_line_of_a_picture_draws_it(tmp_path: Path) -> None:
    session = FlightSession.of(load_scenario("tango-space-10m"))
    for _ in range(20):
        session.step(PilotCommand(), 0.033)
    lines = dict(command_lines(session, options_of(session), "tango-space-10m").lines)
    words = shlex.split(lines["this picture"])
    assert words[0] == "flyaround"
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    truth, scene = read_truth(tmp_path / "frame.json"), session.scene()
    assert truth.t_s == session.t_s
    assert np.allclose(truth.t_camera_from_target_m, scene.t_camera_from_target_m, rtol=0, atol=1e-9)
    assert np.allclose(truth.q_camera_from_target_wxyz, scene.q_camera_from_target_wxyz, rtol=0, atol=1e-12)


def test_what_a_line_cannot_say_is_said() -> None:
    session = FlightSession.of(load_scenario("tango-space-10m"))
    options = options_of(session)
    assert command_lines(session, options, "tango-space-10m").left_out == ()
    session.craft.take_over()
    options.settings.exposure_stops = 1.0
    found = command_lines(session, options, "tango-space-10m", "out/console/x.json")
    assert "this picture" not in dict(found.lines)
    assert dict(found.lines)["the picture saved last"] == "flyaround render --from-truth out/console/x.json"
    assert len(found.left_out) == 2


def test_a_scenario_of_a_file_is_named_by_it_and_one_of_no_file_by_nothing() -> None:
    session = FlightSession.of(load_scenario("tango-space-10m"), seed=7)
    options = options_of(session)
    named = dict(command_lines(session, options, "my flights/mine.toml").lines)
    assert named["this console"] == "flyaround sim 'my flights/mine.toml' --seed 7"
    assert command_lines(session, options, "").lines == ()
    assert "in no file" in command_lines(session, options, "").left_out[0]
