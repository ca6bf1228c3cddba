"""The panel Estimator: why it is off, and controls that stay where they are when a result comes."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.jobs.estimates import ComparedEstimate
from flyaround.gui.jobs.estimator_process import Answer
from flyaround.gui.panels.estimator import EstimatorPanel
from flyaround.simulator.errors import UserError
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying()
    yield made
    made.close()


def draw(window: HeadlessWindow, console: Console) -> dict[str, tuple[float, float]]:
    """Positions of the controls by their labels."""
    panel = EstimatorPanel(window)
    for _ in range(2):
        window.noted.clear()
        with window.panel("estimator", 420.0, 1400.0):
            panel.draw(console)
    return {n.label: n.middle for n in window.noted if n.what == "control" and n.label != "end_plot"}


def test_the_reason_why_it_is_off_stands_in_the_panel(
    window: HeadlessWindow, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimates = console.jobs.estimates

    def refuse(_picture: object) -> None:
        raise UserError("the estimator cannot be made: x.npz is no network")

    monkeypatch.setattr(estimates, "_turn", refuse)
    estimates.start()
    estimates.update(None)
    draw(window, console)
    assert not estimates.on
    assert "the estimator cannot be made: x.npz is no network" in [n.label for n in window.noted]


def test_a_result_moves_no_control(window: HeadlessWindow, console: Console) -> None:
    before = draw(window, console)
    assert "Stages as pictures" in str(before)
    answer = Answer(
        accepted=False,
        reason="no edges",
        q_camera_from_target_wxyz=None,
        t_camera_from_target_m=None,
        confidence=0.1,
        stages_ms={"propose": 40.0},
        counts={},
    )
    console.jobs.estimates.newest = ComparedEstimate(
        method="hybrid",
        t_s=1.0,
        done_s=1.0,
        answer=answer,
        range_m=10.0,
        E_R_deg=None,
        E_T_m=None,
        size_px=(960, 600),
    )
    console.jobs.estimates.history.append(console.jobs.estimates.newest)
    assert draw(window, console) == before


def test_a_click_on_a_small_stage_brings_its_large_picture_into_sight(
    window: HeadlessWindow, console: Console
) -> None:
    jpeg = cv2.imencode(".jpg", np.zeros((30, 48, 3), np.uint8))[1].reshape(-1)
    stages = {f"stage {k}": jpeg for k in range(12)}
    estimates = console.jobs.estimates
    estimates.newest = ComparedEstimate(
        method="hybrid",
        t_s=1.0,
        done_s=1.0,
        answer=Answer(
            accepted=False,
            reason="no edges",
            q_camera_from_target_wxyz=None,
            t_camera_from_target_m=None,
            confidence=0.1,
            stages_ms={"propose": 40.0},
            counts={},
            stages=stages,
        ),
        range_m=10.0,
        E_R_deg=None,
        E_T_m=None,
        size_px=(48, 30),
    )
    panel, height = EstimatorPanel(window), 500.0

    def turn(wheel: float = 0.0) -> list[tuple[float, float]]:
        window.noted.clear()
        window.plain.get_io().add_mouse_wheel_event(0.0, wheel)
        with window.panel("estimator", 420.0, height):
            panel.draw(console)
        return [n.middle for n in window.noted if n.label == "image"]

    io = window.plain.get_io()
    io.add_mouse_pos_event(200.0, 250.0)
    for _ in range(60):
        large, *small = turn(-3.0)
    assert large[1] < 0.0, "it is out of sight"
    io.add_mouse_pos_event(*small[-1])
    turn()
    for down in (True, False):
        io.add_mouse_button_event(0, down)
        turn()
    for _ in range(3):
        large, *_ = turn()
    assert 0.0 < large[1] < height
