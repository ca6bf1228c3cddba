"""The tour's steps are ticked by what was done, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.jobs.estimates import ComparedEstimate
from flyaround.gui.panels.tour import STEPS, TourPanel, TourStep
from flyaround.gui.style import Rgba
from flyaround.gui.text_widgets import TextWidgets
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer


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


def framed_at(screen: Pointer, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, ...]]:
    """Return left, top, right and bottom of what the tour frames in the next frame."""
    found: list[tuple[float, ...]] = []
    real = TextWidgets.frame

    def frame(w: TextWidgets, rgba: Rgba, rect: tuple[float, ...] = (), *more: object) -> None:
        found.extend([tuple(rect)] * (rgba == style.ACCENT and bool(rect)))
        real(w, rgba, rect, *more)

    with monkeypatch.context() as patch:
        patch.setattr(TextWidgets, "frame", frame)
        screen.turn()
    return found


NAMED = {
    "Stop the clock": ("Pause", ""),
    "Fly by hand": ("HAND: OFF", ""),
    "Come to rest": ("Stop###steer.stop", ""),
    "Estimate the pose": ("Estimate###layout", "Estimate###estimator.run"),
    "Let the autopilot dock": ("Dock###layout", "Autopilot###docking"),
    "Keep a picture": ("Save picture", ""),
}
"""Controls that each step names: the one to begin with, and the one in the panel that it opens."""


@pytest.mark.parametrize("step", STEPS, ids=lambda s: s.title)
@pytest.mark.parametrize("hidden", ["behind a tab", "closed"])
def test_the_frame_holds_the_control_that_the_step_names(
    step: TourStep, hidden: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Pointer(opened=("tour",))
    console = screen.console
    for name in ("steering", "sensor"):
        console.open_panel(name, shown=True)
        for _ in range(6):
            screen.turn()
    if hidden == "closed":
        for name in ("chaser", "picture", "docking", "estimator"):
            console.open_panel(name, shown=False)
    for _ in range(3):
        screen.turn()
    console.help.tour_step = STEPS.index(step)
    for _ in range(12):
        screen.turn()
    first, then = NAMED[step.title]
    for control in filter(None, (first, then)):
        if control == then:
            screen.press(first)
            for _ in range(20):
                screen.turn()
        ((left, top, right, bottom),) = framed_at(screen, monkeypatch)
        x, y = screen.place(control)
        assert left < x < right, control
        assert top < y < bottom, control
        assert bottom - top < 60.0, control
        panel = screen.rect(step.place if control == (then or first) else "##MainMenuBar")
        assert bottom <= panel[1] + panel[3], control
        assert all(
            a <= b for a, b in zip((0, 0, right, bottom), (left, top, *screen.window.size), strict=True)
        )
        # nothing lies in front of it
        assert "tour" not in console.help.behind
        assert step.place not in console.help.behind or control != (then or first)
    screen.close()
