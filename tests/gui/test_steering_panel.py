"""The panel Steering: a point to fly to, and a table of planned burns."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.steering import SteeringPanel
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.do("steer.toggle")
    yield made
    made.close()


def test_a_burn_is_added_and_taken_back_by_a_button(window: HeadlessWindow, console: Console) -> None:
    panel = SteeringPanel(window)
    for count in (1, 2):
        window.press("Add a burn", lambda: panel.draw(console), height=1400.0)
        assert len(console.session.craft.steering.burns.burns) == count
    first, second = console.session.craft.steering.burns.burns
    assert second.start_s > first.end_s
    window.press("x##burn0", lambda: panel.draw(console), height=1400.0)
    assert console.session.craft.steering.burns.burns == (second,)


def test_fly_by_so_much_starts_from_here(window: HeadlessWindow, console: Console) -> None:
    panel = SteeringPanel(window)
    here = console.session.craft.state_lvlh()[0]
    done: list[tuple[object, ...]] = []
    console.do = lambda *what: done.append(what)  # type: ignore[method-assign]
    for label in ("Fly there", "Fly by so much"):
        window.press(label, lambda: panel.draw(console), height=1400.0)
    assert done[0] == ("guidance.waypoint", 0.0, 0.0, 0.0)
    assert done[1][0] == "guidance.waypoint"
    assert done[1][1:] == pytest.approx(here, abs=1e-3)
