"""Cautions wait until they are seen or until their cause ends."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.console import Console
from tests.harness.flown_console import console_flying


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-space-10m")
    made.do("guidance.hold")
    yield made
    made.close()


def waiting(console: Console) -> list[str]:
    console.pass_time(20)
    return [m.text for m in console.waiting]


def plan(console: Console, t_s: float = 500.0) -> None:
    console.do("burn.plan", t_s, 0.0, 0.01, 0.0)


def test_the_caution_of_a_burn_goes_with_it(console: Console) -> None:
    console.do("time.pause")
    plan(console)
    plan(console, 700.0)
    assert len(waiting(console)) == 2
    console.do("burn.cancel", 500.0)
    assert len(waiting(console)) == 1
    assert "T+700.0 s" in waiting(console)[0]
    console.do("guidance.drift")
    assert waiting(console) == []


def test_the_caution_of_a_plume_goes_once_it_is_clear(console: Console) -> None:
    for command, *value in (("guidance.drift",), ("steer.attitude", "target"), ("steer.arm", True)):
        console.do(command, *value)
    strikes = "the plume strikes the target: push sideways, or from farther away"
    for _ in range(2):
        for _ in range(100):
            console.pass_time(100, frozenset({"steer.back"}))
            if console.waiting:
                break
        assert waiting(console) == [strikes]
        console.do("time.rate", "10")
        for _ in range(10):
            console.pass_time(200)
        console.do("time.rate", "1")
        assert waiting(console) == []


def test_other_cautions_stay(console: Console) -> None:
    console.do("time.pause")
    console.say("the disk is full", "caution")
    assert waiting(console) == ["the disk is full"]
