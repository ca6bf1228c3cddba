"""The panel Kept flights: name, date, scenario and length of each; a click replays one, a damaged one says why not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.flights import FlightsPanel, flight_row, kept_flights
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer


@pytest.fixture
def console(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    monkeypatch.chdir(tmp_path)
    made = console_flying("tango-vbar-approach")
    for _ in range(60):
        made.pass_time(50)
    yield made
    made.close()


def keep(console: Console, *folder: str) -> str:
    console.do("timeline.keep", *folder)
    while console.jobs.keeping:
        console.pass_time(0)
    return console.flights.files[-1]


def test_a_kept_flight_is_listed_with_scenario_and_length(console: Console, window: HeadlessWindow) -> None:
    replay = keep(console)
    panel = FlightsPanel(window)
    done: list[tuple[object, ...]] = []
    console.do = lambda *what: done.append(what)  # type: ignore[method-assign]
    console.flights.unsaved.clear()
    window.press("tango-vbar-approach-001", lambda: panel.draw(console))
    texts = [n.label for n in window.noted if n.what == "text"]
    assert any(text.endswith("tango-vbar-approach   3 s") for text in texts)
    assert done == [("scenario.open", replay)]


def test_flights_elsewhere_are_listed_and_missing_ones_are_not(console: Console, tmp_path: Path) -> None:
    elsewhere = keep(console, str(tmp_path / "mine"))
    here = keep(console)
    assert kept_flights([elsewhere, str(tmp_path / "gone" / "replay.toml")]) in (
        [here, elsewhere],
        [elsewhere, here],
    )


def test_a_damaged_flight_says_what_is_wrong(console: Console, window: HeadlessWindow) -> None:
    replay = Path(keep(console))
    replay.write_text("[chaser]\nkind = 7\n")
    _, text, problem = flight_row(str(replay))
    assert text == ""
    assert "replay.toml" in problem
    panel = FlightsPanel(window)
    with window.panel("flights", 420.0, 780.0):
        panel.draw(console)
    assert problem in [n.label for n in window.noted]


def test_without_flights_it_says_how_to_keep_one(console: Console, window: HeadlessWindow) -> None:
    panel = FlightsPanel(window)
    with window.panel("flights", 420.0, 780.0):
        panel.draw(console)
    assert any("Keep flight" in n.label for n in window.noted)


def test_an_opened_flight_can_be_sought_through_at_once(console: Console) -> None:
    console.do("steer.toggle")
    replay = keep(console)
    console.do("scenario.open", replay)
    while console.opener.is_busy():
        console.pass_time(0)
    session = console.session
    console.do("timeline.seek", 2.0)
    assert session.t_s == pytest.approx(2.0)
    assert session.look_back.timeline.end_s == pytest.approx(3.0, abs=0.11)
    assert len(session.look_back.path(session.craft.world)) > 10
    # flying on from there drops nothing that is not on disk
    console.do("guidance.hold")
    assert console.asked is None
    console.pass_time(100)
    assert not session.look_back.active
    console.do("timeline.seek", 1.0)
    console.do("guidance.drift")
    assert console.asked is not None, "this part was flown by hand"


def test_another_flight_begins_with_its_own_exposure(console: Console) -> None:
    console.do("picture.exposure", 3.0)
    console.do("scenario.open", "tango-flyaround")
    while console.opener.is_busy():
        console.pass_time(0)
    assert console.options.settings.exposure_stops == 0.0


def test_an_opened_flight_waits_for_play_and_stays_whole_under_every_panel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    screen = Pointer("tango-flyaround", panels=False)
    console = screen.console
    for _ in range(30):
        console.pass_time(100)
    console.do("scenario.open", keep(console))
    while console.opener.is_busy():
        console.pass_time(0)
    session = console.session
    console.do("layout.dock")
    for _ in range(3):
        screen.turn()
        console.pass_time(50)
    assert session.clock.paused
    assert session.t_s == 0.0
    assert any(text.startswith("T+00:00:00.0 of 00:00:03") for text in screen.texts())
    hint = next(text for text in screen.texts() if text.startswith("REPLAY"))
    assert hint.endswith("the slider seeks"), "nothing of it is left out"
    console.do("time.pause")
    for _ in range(3):
        screen.turn()
        console.pass_time(100)
    assert session.t_s == pytest.approx(0.3)
    assert session.look_back.replays
    assert session.look_back.timeline.end_s == pytest.approx(3.0, abs=0.11)
    screen.close()


@pytest.mark.parametrize("rate", ["10", "0.5"])
def test_time_runs_at_1x_after_a_replay_and_in_a_flight_that_is_opened_again(
    console: Console, rate: str
) -> None:
    console.do("steer.toggle")
    for _ in range(40):
        console.pass_time(200)
    console.do("timeline.seek", 1.0)
    console.do("time.rate", rate)
    console.do("time.pause")
    for _ in range(200):
        console.pass_time(200)
        if console.session.clock.paused:
            break
    clock = console.session.clock
    assert not console.session.look_back.active
    assert clock.paused
    assert clock.rate == min(float(rate), 1.0)
    assert any("time runs at 1x again" in m.text for m in console.messages) == (float(rate) > 1.0)
    # left at a rate for another flight
    console.do("time.rate", rate)
    console._begin(type(console.session).of(console.session.plan.scenario), "")
    console.do("scenario.back")
    assert console.session.clock is clock
    assert clock.paused
    assert clock.rate == min(float(rate), 1.0)
