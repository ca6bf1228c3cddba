"""A jump to a hold point says what it waits for, can be stopped, and ends with a sentence if it comes no nearer."""

from __future__ import annotations

import pytest

from flyaround.gui.jobs.all import running_jobs
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer

TUMBLING = "tango-vbar-approach"


def test_a_hold_point_that_is_not_reached_ends_the_jump_with_the_reason() -> None:
    console = console_flying(TUMBLING)
    console.do("docking.approach", True)
    console.do("docking.go")
    session = console.session
    hold_points = session.craft.docking.hold_points
    for goal in ("H1", "H2", "H3"):
        assert hold_points.next.name == goal
        console.do("time.next-hold-point")
        assert f"to {goal}" in console.messages[-1].text
        shares = []
        for _ in range(2000):
            if not session.clock.jump:
                break
            (job,) = running_jobs(console.jobs, flight=session)
            assert job.text.startswith(f"jump to {goal}: ")
            assert job.end == "time.jump-end"
            shares.append(job.share)
            console.pass_time(250)
        assert shares == sorted(shares)
        assert min(shares) >= 0
        console.messages.acknowledge()
        if goal != "H3":
            assert f"the chaser waits at {goal}" in console.messages[-1].text
            console.do("docking.go")
    assert session.t_s < 1500
    assert (session.clock.rate, session.clock.jump) == (1.0, "")
    (said,) = [m.text for m in console.messages if "H3 is not reached" in m.text]
    assert "no nearer than 5." in said
    assert "corridor at the port" in said
    # with the remedy the next jump arrives
    console.do("docking.keep-out", "port")
    console.do("time.next-hold-point")
    while session.clock.jump:
        console.pass_time(250)
    assert "the chaser waits at H3" in console.messages[-1].text
    console.close()


def test_a_caution_of_a_jump_ends_when_it_goes_on() -> None:
    console = console_flying(TUMBLING)
    console.do("docking.approach", True)
    console.say("the jump has ended: H1 is not reached", "caution")
    console.pass_time(20)
    assert any("not reached" in m.text for m in console.messages.waiting)
    console.do("time.next-hold-point")
    console.pass_time(20)
    assert not any("not reached" in m.text for m in console.messages.waiting)
    console.close()


@pytest.mark.parametrize("event", ["eclipse", "hold-point"])
def test_a_jump_is_shown_and_stopped_in_the_strip_of_jobs(event: str) -> None:
    screen = Pointer("tango-vbar-approach", panels=False)
    console = screen.console
    console.do("docking.approach", True)
    console.do(f"time.next-{event}")
    screen.turn()
    assert any(text.startswith("jump to ") for text in screen.texts())
    screen.press("Stop the jump")
    screen.turn()
    assert not console.session.clock.jump
    assert console.session.clock.rate == 1.0
    assert not screen.has("Stop the jump")
    assert console.losses[:-1] == []
    screen.close()
