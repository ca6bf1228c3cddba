"""The panel Estimator: why it is off, and controls that stay where they are when a result comes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.jobs.estimates import ComparedEstimate
from flyaround.gui.jobs.estimator_process import Answer
from flyaround.gui.panels.estimator import EstimatorPanel
from flyaround.gui.views.stage import StageView
from flyaround.hil.board.hybrid.debug.stage_pictures import caption
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import ByteArray
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying()
    yield made
    made.close()


def draw(window: HeadlessWindow, console: Console, width: float = 420.0) -> dict[str, tuple[float, float]]:
    """Positions of the controls by their labels."""
    panel = EstimatorPanel(window)
    for _ in range(2):
        window.noted.clear()
        with window.panel("estimator", width, 1400.0):
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


def declined(**stages: ByteArray) -> ComparedEstimate:
    """An estimate without a pose, with these pictures of its stages."""
    answer = Answer(
        accepted=False,
        reason="no edges",
        q_camera_from_target_wxyz=None,
        t_camera_from_target_m=None,
        confidence=0.1,
        stages_ms={"propose": 40.0},
        stages=stages,
    )
    return ComparedEstimate(
        method="hybrid",
        t_s=1.0,
        done_s=1.0,
        answer=answer,
        range_m=10.0,
        E_R_deg=None,
        E_T_m=None,
        size_px=(48, 30),
    )


@pytest.mark.parametrize("width", [254.0, 420.0])
def test_the_pose_of_the_last_answer_stands_whole_with_its_time_and_errors(
    window: HeadlessWindow, console: Console, width: float
) -> None:
    pose = {
        "q_camera_from_target_wxyz": (0.5, -0.5, 0.5, -0.5),
        "t_camera_from_target_m": (-0.1234, 2.0, 110.25),
    }
    answered = declined()
    answered = replace(
        answered, answer=replace(answered.answer, accepted=True, reason="", **pose), E_R_deg=0.25, E_T_m=0.013
    )
    console.jobs.estimates.newest = answered
    for _ in range(110):
        console.pass_time(100)
    draw(window, console, width)
    texts = [" ".join(n.label.split()) for n in window.noted if n.what == "text"]
    for figures in ("-0.123 +2.000 +110.250", "0.250°", "13.0 mm"):
        assert figures in texts
    assert "Position error / range" in texts
    assert texts.count("+0.5000 -0.5000") == 2, "in two lines"
    assert "accepted, 10.0 s ago" in texts
    for reason, remedy in (("no edges", False), ("target too small in the picture", True)):
        answer = replace(declined().answer, reason=reason)
        console.jobs.estimates.newest = replace(declined(), answer=answer)
        draw(window, console, width)
        texts = [n.label for n in window.noted if n.what == "text"]
        assert not any("0.5000" in text for text in texts)
        assert "no pose" in texts
        assert f"declined, 10.0 s ago: {reason}" in texts
        assert any("fly nearer" in text for text in texts) is remedy


def test_a_result_moves_no_control(window: HeadlessWindow, console: Console) -> None:
    before = draw(window, console)
    assert "Stages as pictures" in str(before)
    console.jobs.estimates.newest = declined()
    console.jobs.estimates.history.append(console.jobs.estimates.newest)
    assert draw(window, console) == before


def test_a_click_on_a_small_stage_shows_it_in_the_place_of_the_view() -> None:
    screen = Pointer("tango-flyaround", panels=False)
    console = screen.console
    console.jobs.estimates.newest = declined(
        edges=cv2.imencode(".jpg", np.zeros((30, 48, 3), np.uint8))[1].reshape(-1),
        broken=np.zeros(20, np.uint8),
    )
    console.open_panel("estimator", shown=True)
    console.open_panel("camera", shown=True)
    for _ in range(3):
        screen.turn()
    left, top, wide, tall = screen.rect("camera")
    screen.press("image")
    for _ in range(3):
        screen.turn()
    assert "broken" not in "".join(n.label for n in screen.window.noted)
    x, y = screen.place("image")
    assert left < x < left + wide
    assert top < y < top + tall
    _, _, width, _ = screen.rect("stage")
    assert width > 0.9 * wide
    # what the newest estimate lacks is said
    console.jobs.estimates.newest = declined()
    screen.turn()
    assert not screen.has("image")
    screen.close()


STREAMS = ("wge_stream", "sh_stream", "lsd_stream", "wge_merged", "sh_merged", "lsd_merged")


def test_stages_and_methods_are_named_in_words(window: HeadlessWindow, console: Console) -> None:
    blank = cv2.imencode(".jpg", np.zeros((30, 48, 3), np.uint8))[1].reshape(-1)
    answered = declined(**dict.fromkeys((*STREAMS, "learned_proposal"), blank))
    estimates = console.jobs.estimates
    estimates.newest, estimates.stage = answered, "lsd_stream"
    estimates.method, estimates.on = "net:out/own.npz", True
    (job,) = running_jobs(console.jobs)
    assert job.text.startswith("network out/own.npz ")
    draw(window, console)
    said = [n.label for n in window.noted]
    window.noted.clear()
    with window.panel("stage", 620.0, 400.0):
        StageView(window).draw(console)
    # behind ### is the identity of a control, which nobody sees
    said = [text.partition("###")[0] for text in [*said, *(n.label for n in window.noted)]]
    assert sum("Lines: weak gradient elimination" in text for text in said) == 2, "small, and in the list"
    words = {word for text in said for word in re.split(r"[^a-z]+", text.lower())}
    assert not words & {"wge", "sh", "lsd", "net"}


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        ("WGE stream", "lines, weak gradient elimination"),
        ("S&H merged", "merged lines, Sobel and Hough"),
        ("LSD stream", "lines, line segment detector"),
        ("all merged", "merged lines"),
        ("own stream", "own stream"),
    ],
)
def test_the_picture_of_a_stage_names_its_detector(stream: str, words: str) -> None:
    assert caption(stream) == words


def test_stages_are_in_sight_without_scrolling_the_pose_away() -> None:
    screen = Pointer("tango-flyaround")
    console = screen.console
    console.do("layout.estimate")
    console.open_panel("estimator", shown=True)
    picture = cv2.imencode(".jpg", np.zeros((300, 480, 3), np.uint8))[1].reshape(-1)
    without = replace(declined(), E_R_deg=0.25, E_T_m=0.013)
    pose = {"q_camera_from_target_wxyz": (0.5, -0.5, 0.5, -0.5), "t_camera_from_target_m": (-0.1, 2.0, 110.0)}
    stages = dict.fromkeys(("edges", "lines", "corners", "groups"), picture)
    answer = replace(without.answer, accepted=True, reason="", network="shipped", **pose, stages=stages)
    for estimate in (without, replace(without, answer=answer)):
        console.jobs.estimates.newest = estimate
        for _ in range(6):
            screen.turn()
    assert screen.window.plain.internal.find_window_by_name("###estimator").scroll.y == 0.0
    top, tall = screen.rect("estimator")[1::2]
    heights = [
        n.middle[1] for n in screen.window.noted if n.label in {"0.250°", "13.0 mm"} or n.label == "image"
    ]
    assert len(heights) == 6
    # the first row of two is whole
    assert all(top < y < top + tall - 40.0 for y in heights[:4])
    screen.close()
