"""A command that drops or leaves a flight that is in no file asks once and names it; an abort never asks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from flyaround.gui.script import Line, Script
from tests.harness.pointer import Pointer

FLYING = (
    "docking.approach on",
    "guidance.hold",
    "guidance.waypoint 20 0 0",
    "burn.plan 500 0 0.01 0",
    "steer.pulse forward",
    "steer.stick-thrust 0 0 1",
    "steer.stop",
    "time.next-eclipse",
)


@pytest.fixture
def back() -> Iterator[Pointer]:
    """A console that shows T+1 of a flight of 4 s."""
    made = Pointer("tango-flyaround", panels=False)
    for _ in range(20):
        made.console.pass_time(200)
    made.console.do("timeline.seek", 1.0)
    yield made
    made.close()


def end_s(back: Pointer) -> float:
    for _ in range(3):
        back.console.pass_time(20)
    return back.console.session.look_back.timeline.end_s


@pytest.mark.parametrize("line", FLYING)
def test_a_command_that_flies_on_asks_first(back: Pointer, line: str) -> None:
    back.console.do_line(line)
    assert end_s(back) > 3.5
    assert back.console.session.look_back.active
    back.turn()
    assert any("Fly on from T+00:00:01? The 3 s flown after it are dropped." in text for text in back.texts())
    back.press("Stay here")
    assert end_s(back) > 3.5
    assert back.console.flown_by == "scenario's guidance"
    back.turn()
    assert not back.has("Stay here")


def test_the_answer_runs_what_was_asked_about(back: Pointer) -> None:
    back.console.do("docking.approach", True)
    back.turn()
    back.press("Fly on", -1)
    assert back.console.session.craft.steering.autopilot
    assert end_s(back) < 2.0
    assert [line.name for line in back.console.log.lines[-2:]] == ["timeline.fly-on", "docking.approach"]
    back.console.do("guidance.hold")
    back.turn()
    assert not back.has("Stay here"), "at the end of the flight nothing is lost"
    back.console.do("timeline.other-future")
    assert end_s(back) > 3.5


def test_a_held_key_asks_and_pushes_nothing(back: Pointer) -> None:
    back.console.do("steer.arm", True)
    for _ in range(5):
        back.console.pass_time(50, frozenset({"steer.forward"}))
    assert end_s(back) > 3.5
    back.turn()
    assert back.has("Stay here")


@pytest.mark.parametrize(
    "line", ["steer.arm on", "steer.stick-thrust 0 0 0", "picture.noise off", "time.pause"]
)
def test_what_flies_nothing_asks_nothing(back: Pointer, line: str) -> None:
    back.console.do_line(line)
    back.turn()
    assert not back.has("Stay here")


def test_a_script_has_given_its_answer(back: Pointer) -> None:
    now = back.console.clock_ms
    back.console.play(Script((Line(now + 10, "do", "guidance.hold", ()),)))
    assert end_s(back) < 2.0


def test_an_abort_acts_at_once_on_the_present_flight(back: Pointer) -> None:
    back.console.do("docking.abort")
    assert end_s(back) > 3.5
    back.turn()
    assert not back.has("Stay here")
    session = back.console.session
    assert session.craft.mode == "steer"
    assert session.t_s > 3.9, "time runs on from the end of the flight"
    assert any("aborted the present flight, at T+00:00:04" in m.text for m in back.console.messages)


def test_a_restart_asks_once_if_the_flight_is_in_no_file(back: Pointer) -> None:
    console = back.console
    console.do("timeline.end")
    console.do("time.restart")
    assert console.session.t_s == 0.0, "nobody flew it"
    console.do("time.pause")
    for _ in range(10):
        console.pass_time(200)
    console.do("guidance.hold")
    end = console.session.t_s
    console.do("time.restart")
    back.turn()
    assert console.session.t_s == end
    assert any("The flight of tango-flyaround, 2 s, is not kept." in text for text in back.texts())
    back.escape()
    back.turn()
    assert console.session.t_s == end
    assert not back.has("Stay here")
    console.do("time.restart")
    back.turn()
    back.press("Restart")
    assert console.session.t_s == 0.0
    back.turn()
    assert not back.has("Stay here")


def test_flying_on_by_its_own_command_asks_if_the_flight_is_in_no_file(back: Pointer) -> None:
    console = back.console
    console.do("timeline.end")
    console.do("guidance.hold")
    console.do("timeline.seek", 1.0)
    console.do("timeline.fly-on")
    assert end_s(back) > 3.5
    back.turn()
    back.press("Fly on", -1)
    assert end_s(back) < 2.0
    back.turn()
    assert not back.has("Stay here"), "one question"


def test_the_question_before_another_scenario_names_both(back: Pointer) -> None:
    console = back.console
    console.do("timeline.end")
    console.do("guidance.hold")
    console.do("scenario.open", "tango-close-3m")
    back.turn()
    assert "Leave the flight of tango-flyaround, 4 s, for tango-close-3m? It is not kept." in back.texts()
    back.press("Fly tango-close-3m")
    assert console.opener.name == "tango-close-3m"


QUESTIONS = ("docking.keep-out lifted", "scenario.open tango-close-3m", "time.restart", "window.quit")


@pytest.mark.parametrize("line", QUESTIONS)
def test_the_flight_stands_still_while_a_question_stands_and_goes_on_after_it(line: str) -> None:
    at = Pointer("tango-vbar-approach", panels=False)
    console = at.console
    console.do("guidance.hold")
    console.do("time.rate", "5")
    console.pass_time(200)
    t_s = console.session.t_s
    console.do_line(line)
    for _ in range(3):
        console.pass_time(200)
        at.turn()
    assert console.session.t_s == t_s
    at.escape()
    at.turn()
    console.pass_time(200)
    assert console.session.t_s == pytest.approx(t_s + 1.0)
    assert (console.session.clock.rate, console.session.clock.paused) == (5.0, False)
    at.close()


def test_a_key_that_is_let_go_behind_a_question_does_not_push_after_it(back: Pointer) -> None:
    console = back.console
    console.do("timeline.end")
    console.do("time.pause")
    console.do("steer.arm", True)
    for _ in range(2):
        console.pass_time(100, frozenset({"steer.forward"}))
    console.do("window.quit")
    console.pass_time(100)
    back.escape()
    back.turn()
    spent = console.session.state.propellant
    console.pass_time(100)
    assert console.session.state.propellant == spent


def test_an_abort_acts_behind_a_question_and_takes_it_away(back: Pointer) -> None:
    console = back.console
    console.do("guidance.hold")
    assert console.asked is not None
    console.do("docking.abort")
    t_s = console.session.t_s
    console.pass_time(200)
    assert console.session.t_s > t_s
    back.turn()
    assert not back.has("Stay here")


def test_the_way_back_is_named_as_a_path_of_the_menus(back: Pointer) -> None:
    console = back.console
    console.do("guidance.hold")
    assert console.asked is not None
    path = console.asked.way_back.partition(" brings")[0].split(" > ")
    assert path == ["Flight", "Timeline", "Swap future"]
    back.turn()
    # the second one: that of the strip lies beside the question
    back.press("Fly on", 1)
    back.menu(*path)
    assert console.session.look_back.timeline.end_s > 3.5

    assert console.jobs.keeping == []


def test_a_flight_is_kept_and_left_by_one_click(
    back: Pointer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    console = back.console
    console.do("timeline.end")
    console.do("guidance.hold")
    left = console.session
    console.do("scenario.open", "tango-close-3m")
    back.turn()
    back.press("Keep the flight and go")
    for _ in range(3000):
        console.pass_time(20)
        if console.session is not left and not console.jobs.keeping:
            break
        time.sleep(0.01)
    assert console.session.plan.scenario.name == "tango-close-3m"
    assert console.losses == []
    assert list(tmp_path.rglob("replay.toml"))
