"""Flight time after a flight was written is named when it would be lost; messages say the time of the flight."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.harness.pointer import Pointer

SINCE = "flown since its file was written"


@pytest.fixture
def screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Pointer]:
    monkeypatch.chdir(tmp_path)
    made = Pointer("tango-flyaround", panels=False)
    yield made
    made.close()


def fly(screen: Pointer, seconds: float) -> None:
    for _ in range(round(seconds / 0.2)):
        screen.console.pass_time(200)


def keep(screen: Pointer) -> None:
    screen.console.do("timeline.keep-all")
    while screen.console.jobs.keeping:
        screen.console.pass_time(0)


def test_the_seconds_since_the_file_are_named_and_kept(screen: Pointer) -> None:
    console = screen.console
    console.do("guidance.hold")
    fly(screen, 4.0)
    keep(screen)
    assert console.losses == []
    console.do("time.rate", "50")
    fly(screen, 4.0)
    (lost,) = console.losses
    assert lost == f"the flight of tango-flyaround, 3 min 24 s, has 3 min 20 s {SINCE}"
    screen.menu("File", "Quit")
    assert any(SINCE in text for text in screen.texts())
    screen.press("Keep all flights")
    console.do("time.pause")
    while console.jobs.keeping:
        console.pass_time(0)
    assert len(console.flights.files) == 2
    assert console.losses == []


def test_a_flight_that_branches_off_has_lost_what_follows(screen: Pointer) -> None:
    console = screen.console
    console.do("guidance.hold")
    fly(screen, 10.0)
    keep(screen)
    console.do("timeline.seek", 4.0)
    fly(screen, 1.0)
    assert console.losses == []
    console.do("timeline.fly-on", asks=False)
    fly(screen, 3.0)
    (lost,) = console.losses
    assert "3 s flown since" in lost
    # a question before it is left says the same
    console.do("scenario.open", "tango-night")
    assert console.asked is not None
    assert f"3 s {SINCE}" in console.asked.text


def test_a_command_alone_loses_nothing_of_a_kept_flight(screen: Pointer) -> None:
    console = screen.console
    console.do("guidance.hold")
    fly(screen, 4.0)
    keep(screen)
    console.do("guidance.drift")
    fly(screen, 0.4)
    assert console.losses == []
    fly(screen, 3.0)
    assert len(console.losses) == 1
    # what is left after a seek is in the file
    console.do("timeline.seek", 3.0)
    console.do("timeline.fly-on", asks=False)
    fly(screen, 0.4)
    assert console.losses == []


def test_messages_have_the_time_of_the_flight_and_of_the_day(screen: Pointer) -> None:
    console = screen.console
    console.do("time.rate", "100")
    fly(screen, 1.0)
    console.do("guidance.vbar", 0.2)
    console.do("window.acknowledge")
    console.open_panel("log", shown=True)
    screen.turn()
    screen.turn()
    texts = screen.texts()
    assert any(text.startswith("T+ is the time of the flight") for text in texts)
    assert any(re.fullmatch(r"T\+00:01:4\d\.\d  \d\d:\d\d:\d\d", text) for text in texts)
    assert any(re.match(r"caution until \d\d:\d\d:\d\d: the hold point", text) for text in texts)
