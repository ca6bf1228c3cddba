"""The tour's steps are ticked by what was done, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.gui.jobs.estimates import ComparedEstimate
from flyaround.gui.panels.tour import STEPS, TourPanel
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture
def tour():
    window, console = HeadlessWindow(), console_flying("tango-space-10m")
    panel = TourPanel(window)

    def turn() -> int:
        with window.panel("tour", 420.0, 780.0):
            panel.draw(console)
        return console.help.tour_step

    yield console, turn
    console.close()
    window.close()


def test_a_step_is_done_when_its_command_was(tour):
    console, turn = tour
    assert turn() == 0
    console.do("overlay.box")
    assert turn() == 0
    console.do("time.pause")
    assert turn() == 1
    console.do("steer.arm")
    assert turn() == 1
    console.pass_time(100, frozenset({"steer.forward"}))
    console.pass_time(100)
    assert turn() == 1, "nothing flies while time stands"
    console.do("time.pause")
    console.pass_time(100, frozenset({"steer.forward"}))
    console.pass_time(100)
    console.do("steer.stop")
    assert (turn(), turn()) == (2, 2), "it still moves"
    while np.linalg.norm(console.telemetry.velocity_lvlh_m_s) > 1e-3:
        assert turn() == 2
        console.pass_time(100)
    assert turn() == 3
    for _ in STEPS:
        console.do("help.tour-next")
    assert turn() == len(STEPS)


def test_a_pulse_counts_as_flying_by_hand(tour):
    console, turn = tour
    console.help.tour_step = 1
    console.do("steer.pulse", "forward")
    assert turn() == 1
    for _ in range(5):
        console.pass_time(100)
    assert turn() == 2


def test_the_estimate_is_done_by_a_pose_and_not_by_the_button(tour):
    console, turn = tour
    console.help.tour_step = next(k for k, s in enumerate(STEPS) if "estimator.run" in s.commands)
    estimating = console.help.tour_step
    console.do("estimator.run", True)
    assert turn() == estimating
    answer = {
        "method": "hybrid",
        "t_s": 0.0,
        "done_s": 0.0,
        "answer": None,
        "range_m": 10.0,
        "size_px": (480, 300),
    }
    console.jobs.estimates.history.append(ComparedEstimate(**answer, E_R_deg=None, E_T_m=None))
    assert turn() == estimating
    console.jobs.estimates.history.append(ComparedEstimate(**answer, E_R_deg=0.4, E_T_m=0.01))
    assert turn() == estimating + 1


def test_every_step_names_commands_that_there_are(tour):
    console, _ = tour
    for doing in STEPS:
        for name in doing.commands:
            assert name in console.table, name
