"""An abort says how far it retreats, or that the chaser is already farther away and what happens instead."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.simulator.runtime.arrays import vec3
from tests.harness.pointer import Pointer

FAR_M = 29.0


@pytest.fixture
def at() -> Iterator[Pointer]:
    made = Pointer("tango-vbar-approach", panels=False, opened=("docking",))
    yield made
    made.close()


def carried_to(console: Console, range_m: float, closing_m_s: float = 0.0) -> None:
    """Put the chaser at a range along-track, closing on the target."""
    craft = console.session.craft
    craft.take_over()
    frame = craft.flight.lvlh(craft.t_s)
    away = frame.R_eci_from_lvlh @ np.array([0.0, 1.0, 0.0])
    turning = np.cross(frame.omega_eci_rad_s, away)
    velocity = range_m * turning - closing_m_s * away
    position = vec3(range_m * away)
    assert craft.steered is not None
    craft.steered = replace(craft.steered, position_eci_m=position, velocity_eci_m_s=vec3(velocity))


def test_an_abort_names_the_distance_that_it_retreats_to(at: Pointer) -> None:
    console = at.console
    carried_to(console, 11.0)
    console.do("docking.abort")
    assert console.messages[-1].text == "abort: the chaser retreats from the target to 24 m"
    assert console.session.craft.steering.aborting
    at.turn()
    assert "ABORT: RETREAT to 24 m" in at.texts()


def test_an_abort_outside_that_distance_says_what_it_does_instead(at: Pointer) -> None:
    console = at.console
    carried_to(console, FAR_M, 0.05)
    console.do("docking.approach", True)
    console.do("docking.abort")
    text = console.messages[-1].text
    assert text.startswith("abort: guidance and burns end, and the chaser drifts: it is 29.0 m away")
    assert "retreats to 24 m" in text
    assert text.endswith("closes at 0.0500 m/s: Stop brakes it")
    steering = console.session.craft.steering
    assert not steering.aborting
    assert steering.doing == ""
    said = [m.text for m in console.messages]
    for _ in range(5):
        console.pass_time(200)
    assert [m.text for m in console.messages] == said
    assert console.waiting == []


def test_a_chaser_at_rest_outside_it_is_not_said_to_close(at: Pointer) -> None:
    carried_to(at.console, FAR_M)
    at.console.do("docking.abort")
    assert "closes" not in at.console.messages[-1].text
