"""The panel Steering: a point to fly to, and a table of planned burns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.console import Console
from flyaround.gui.panels.steering import SteeringPanel, fly_to_warning
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer


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


def flown_to(
    window: HeadlessWindow, console: Console, panel: SteeringPanel, label: str
) -> tuple[object, ...]:
    done: list[tuple[object, ...]] = []
    console.do = lambda *what: done.append(what)  # type: ignore[method-assign]
    window.press(label, lambda: panel.draw(console), height=1400.0)
    return done[0]


def test_fly_there_stays_here_unless_a_point_was_typed(window: HeadlessWindow, console: Console) -> None:
    here = console.session.craft.state_lvlh()[0]
    name, *place = flown_to(window, console, SteeringPanel(window), "Fly there")
    assert name == "guidance.waypoint"
    assert place == pytest.approx(here, abs=0.006)


@pytest.mark.parametrize("from_here", [False, True])
def test_nothing_warns_of_a_point_that_nobody_typed(
    window: HeadlessWindow, console: Console, monkeypatch: pytest.MonkeyPatch, *, from_here: bool
) -> None:
    panel = SteeringPanel(window)
    craft = type(console.session.craft)
    monkeypatch.setattr(craft, "risk_of", lambda *_: "leads through the keep-out sphere of 12 m")
    if from_here:
        window.press("Counted from here", lambda: panel.draw(console), height=1400.0)
    window.noted.clear()
    with window.panel("pressed", 420.0, 1400.0):
        panel.draw(console)
    labels = [n.label for n in window.noted]
    assert any(label.startswith("Fly there###") for label in labels)
    assert not any("Fly there anyway" in label or "keep-out sphere of" in label for label in labels)


def test_a_way_from_here_begins_with_none(window: HeadlessWindow, console: Console) -> None:
    panel = SteeringPanel(window)
    here = console.session.craft.state_lvlh()[0]
    window.press("Counted from here", lambda: panel.draw(console), height=1400.0)
    name, *place = flown_to(window, console, panel, "Fly there")
    assert name == "guidance.waypoint"
    assert place == pytest.approx(here, abs=1e-3)


def test_a_typed_point_ends_with_its_flight() -> None:
    screen = Pointer("tango-vbar-approach", panels=False, opened=("steering",))
    console = screen.console
    flights = [console.session, type(console.session).of(console.session.plan.scenario)]
    screen.type(screen.sight("##point1"), "10")
    done: list[tuple[object, ...]] = []
    real, console.do = console.do, lambda *what: done.append(what)  # type: ignore[method-assign]
    screen.press("Fly there")
    assert done.pop()[2] == 10.0
    console.do = real  # type: ignore[method-assign]
    console._begin(flights[1], "")
    screen.turn()
    console.do = lambda *what: done.append(what)  # type: ignore[method-assign]
    screen.press("Fly there")
    assert done.pop()[1:] == pytest.approx(tuple(flights[1].craft.state_lvlh()[0]), abs=0.006)
    screen.close()


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (
            (0.0, 0.0, 0.0),
            "refused: the straight line to 0.00, 0.00, 0.00 m (radial, along, cross) comes within 0.0 m",
        ),
        ((0.0, -20.0, 0.0), "refused: the straight line"),
        ((11.0, 2.0, 0.0), "leads through the keep-out sphere of 12 m"),
        ((40.0, 30.0, 0.0), "m from here"),
    ],
)
def test_a_point_in_the_keep_out_sphere_is_warned_of_before_it_is_flown_to(
    console: Console, place: tuple[float, float, float], said: str
) -> None:
    warning, colour = fly_to_warning(console.session.craft, np.array(place))
    assert said in warning
    assert (colour == style.QUIET) == ("from here" in said)


def test_a_guidance_moves_no_button(window: HeadlessWindow, console: Console) -> None:
    panel = SteeringPanel(window)

    def places() -> dict[str, tuple[float, float]]:
        for _ in range(2):
            window.noted.clear()
            with window.panel("steering", 420.0, 1700.0):
                panel.draw(console)
        return {n.label: n.middle for n in window.noted if n.what == "control" and "vbar" not in n.label}

    before = places()
    console.do("guidance.vbar")
    after = places()
    assert {label: after[label] for label in before if label in after} == {
        label: before[label] for label in before if label in after
    }
    assert len(set(before) & set(after)) > 15


@pytest.mark.parametrize("width", [220.0, 254.0, 420.0])
def test_a_dangerous_path_is_said_in_full_and_moves_nothing(
    window: HeadlessWindow, console: Console, width: float
) -> None:
    panel = SteeringPanel(window)
    console.do("burn.plan", 60.0, 0.0, 0.001, 0.0)

    def cancel_y() -> float:
        for _ in range(2):
            window.noted.clear()
            with window.panel("steering", width, 1700.0):
                panel.draw(console)
        return next(n.middle[1] for n in window.noted if n.label.startswith("Cancel burns"))

    before = cancel_y()
    risk = "leads through the keep-out sphere of 12.5 m"
    console.session.craft.burns_forecast = lambda: (9.0, risk)  # type: ignore[method-assign]
    assert cancel_y() == before
    assert f"the path {risk}" in [n.label for n in window.noted if n.what == "text"]


def test_the_way_since_taking_over_is_shown_also_when_looking_back(window: HeadlessWindow) -> None:
    console = console_flying("tango-vbar-approach")
    panel = SteeringPanel(window)

    def moved() -> list[str]:
        window.noted.clear()
        with window.panel("steering", 420.0, 1700.0):
            panel.draw(console)
        texts = [n.label for n in window.noted if n.what == "text"]
        return texts[texts.index("Since taking over [m]") + 1].split()

    for _ in range(10):
        console.pass_time(200)
    assert moved() == ["the", "guidance", "flies"]
    console.do("steer.toggle")
    begin = np.array(console.telemetry.position_lvlh_m)
    assert moved() == ["+0.00", "+0.00", "+0.00"]
    console.session.clock.set_rate(10.0)
    for _ in range(20):
        console.pass_time(200)
    way = np.array(console.telemetry.position_lvlh_m) - begin
    assert np.abs(way).max() > 0.5
    assert [float(m) for m in moved()] == pytest.approx(way, abs=0.006)
    console.do("steer.toggle")
    assert moved()[0] == "the"
    console.do("timeline.seek", 10.0)
    assert np.abs([float(m) for m in moved()]).max() > 0.1
    console.close()
