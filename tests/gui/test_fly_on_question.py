"""While an earlier time is shown, what would fly on from it asks before it drops what was flown after it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.script import Line, Script
from tests.harness.pointer import Pointer

FLYING = (
    "docking.approach on",
    "docking.abort",
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
    assert any(
        "Fly on from T+0:01? The 0 min 3 s flown after it are dropped." in text for text in back.texts()
    )
    back.press("Stay here")
    assert end_s(back) > 3.5
    assert back.console.flown_by == "scenario's guidance"
    back.turn()
    assert not back.has("Stay here")


def test_the_answer_runs_what_was_asked_about(back: Pointer) -> None:
    back.console.do("docking.approach", True)
    back.turn()
    back.press("Fly on")
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
