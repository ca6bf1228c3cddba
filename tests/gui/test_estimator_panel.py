"""The panel Estimator: why it is off, and controls that stay where they are when a result comes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.estimator import EstimatorPanel
from flyaround.simulator.errors import UserError
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture
def window() -> Iterator[HeadlessWindow]:
    made = HeadlessWindow()
    yield made
    made.close()


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
