"""An abort says how far it retreats, or that the chaser is already farther away and what happens instead."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.orbit.propagation import elements_from_state
from flyaround.simulator.world.relative.yamanaka_ankersen import elliptic_transition_matrix
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
    assert (
        console.messages[-1].text
        == "abort: the chaser retreats from the target to 24 m; the camera tracks it"
    )
    assert console.session.craft.steering.aborting
    at.turn()
    assert "ABORT: RETREAT to 24 m" in at.texts()


def test_an_abort_outside_that_distance_says_what_it_does_instead(at: Pointer) -> None:
    console = at.console
    carried_to(console, FAR_M, 0.05)
    console.do("docking.approach", True)
    console.do("docking.abort")
    text = console.messages[-1].text
    assert text.startswith("abort: guidance and burns end, and the chaser drifts unguided: it is 29.0 m away")
    assert "retreats to 24 m" in text
    assert text.endswith("closes at 0.0500 m/s: Stop brakes it")
    steering = console.session.craft.steering
    assert not steering.aborting
    assert steering.doing == ""
    said = [m.text for m in console.messages]
    for _ in range(5):
        console.pass_time(200)
    assert [m.text for m in console.messages[: len(said)]] == said
    assert text in [m.text for m in console.messages.waiting]
    # the caution of an unguided drift ends with the drift
    console.do("guidance.hold")
    console.pass_time(20)
    assert console.messages.waiting == []


def test_a_retreat_that_is_done_is_a_caution_while_the_chaser_drifts(at: Pointer) -> None:
    console = at.console
    carried_to(console, 23.0)
    console.do("docking.abort")
    for _ in range(200):
        console.pass_time(250)
        if not console.session.craft.steering.aborting:
            break
    console.pass_time(250)
    assert "the abort is done: the chaser drifts unguided" in [m.text for m in console.messages.waiting]
    console.do("guidance.hold")
    console.pass_time(20)
    assert console.messages.waiting == []


def test_a_far_drift_towards_the_target_is_a_caution(at: Pointer) -> None:
    console = at.console
    carried_to(console, -2000.0)
    console.do("guidance.drift")
    console.pass_time(20)
    assert console.messages.waiting == []
    # on the way that is at the target after 2000 s
    craft, place = console.session.craft, np.array([0.0, -2000.0, 0.0])
    orbit = craft.flight.orbit
    mu = orbit.forces.mu_m3_s2
    after = elliptic_transition_matrix(elements_from_state(*orbit(craft.t_s), mu), 2000.0, mu)
    velocity = np.linalg.solve(after[:3, 3:], -after[:3, :3] @ place)
    frame = orbit.frame(craft.t_s)
    turning = np.cross(frame.omega_eci_rad_s, frame.R_eci_from_lvlh @ place)
    moving = vec3(frame.R_eci_from_lvlh @ velocity + turning)
    assert craft.steered is not None
    craft.steered = replace(craft.steered, velocity_eci_m_s=moving)
    for _ in range(6):
        console.pass_time(200)
    assert [m.text for m in console.messages.waiting] == [
        "the free drift leads through the keep-out sphere of 12 m"
    ]


def test_a_chaser_at_rest_outside_it_is_not_said_to_close(at: Pointer) -> None:
    carried_to(at.console, FAR_M)
    at.console.do("docking.abort")
    assert "closes" not in at.console.messages[-1].text
