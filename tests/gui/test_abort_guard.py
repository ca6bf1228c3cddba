"""The guard of ABORT: while it is open a line tells what a second click does; "not aborted" goes once it is untrue."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.harness.pointer import Pointer


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer("tango-space-10m", panels=False)
    yield made
    made.close()


def seen(screen: Pointer, part: str) -> bool:
    screen.console.pass_time(20)
    screen.turn()
    return any(part in text for text in screen.texts())


def test_an_open_guard_tells_what_a_second_click_does_and_the_time_left(screen: Pointer) -> None:
    console = screen.console
    screen.press("ABORT")
    assert seen(screen, "ABORT: a second click within 5 s retreats to")
    console.clock_ms += 3000
    assert seen(screen, "ABORT: a second click within 2 s retreats to")
    # also beside a caution, and over news
    console.say("too near", "caution")
    console.say("the target is in sunlight again")
    assert seen(screen, "a second click within")
    assert seen(screen, "too near")
    console.clock_ms += 2000
    assert not seen(screen, "a second click within")
    assert not console.session.craft.steering.aborting


@pytest.mark.parametrize("by_key", [False, True])
def test_not_aborted_goes_with_the_next_click(screen: Pointer, *, by_key: bool) -> None:
    console = screen.console
    screen.press("ABORT")
    console.clock_ms += 6000
    assert seen(screen, "no job runs")
    assert seen(screen, "not aborted")
    screen.press("ABORT")
    assert not seen(screen, "not aborted")
    if by_key:
        console.do("docking.abort")
    else:
        screen.press("ABORT? again")
    console.clock_ms += 6000
    assert seen(screen, "abort: the chaser retreats")
    assert not seen(screen, "not aborted")
    assert sum("not aborted" in m.text for m in console.messages) == 1


def test_an_older_note_does_not_come_back_for_one_that_has_ended(screen: Pointer) -> None:
    console = screen.console
    console.say("saved a picture")
    screen.press("ABORT")
    console.clock_ms += 6000
    assert seen(screen, "not aborted") or seen(screen, "not aborted")
    screen.press("ABORT")
    console.do("docking.abort")
    console.do("guidance.hold")
    console.messages.pop()
    assert not seen(screen, "saved a picture")
