"""The autopilot at a hold point: time slows down, the operator is asked, and an expensive hold is a caution."""

import pytest

from flyaround.simulator.piloting.orders import Approach, Drift, Go, PilotCommand
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario


@pytest.fixture
def session() -> FlightSession:
    made = FlightSession.of(load_scenario("tango-vbar-approach"))
    made.order(Approach())
    return made


def fly_until(session: FlightSession, words: str, until_s: float) -> list[str]:
    """Fly until a news contains some words, and return it with those before."""
    said: list[str] = []
    while session.t_s < until_s and not any(words in text for text in said):
        said += [text for _, text in session.step(PilotCommand(), 0.1).news]
    return said


@pytest.mark.parametrize("rate", [1.0, 20.0])
def test_time_slows_down_where_the_autopilot_asks_for_go(session: FlightSession, rate: float) -> None:
    point = session.craft.docking.hold_points.next
    assert point is not None
    session.clock.set_rate(rate)
    said = fly_until(session, "waits at", 900.0)
    text = f"the autopilot waits at {point.name}: Go or No-go"
    assert said[-1] == (text if rate == 1.0 else f"{text}; time runs at 1x again")
    assert session.clock.rate == 1.0
    # once: a rate chosen then stays until the next point
    session.clock.set_rate(20.0)
    session.step(PilotCommand(), 1.0)
    assert session.clock.rate == 20.0
    session.order(Go())
    said = fly_until(session, "waits at", 1800.0)
    assert "waits at H2" in said[-1]
    assert session.clock.rate == 1.0


def test_a_jump_to_a_hold_point_says_once_that_it_is_reached(session: FlightSession) -> None:
    session.jump_to_hold_point()
    said = fly_until(session, "waits at", 900.0)
    session.step(PilotCommand(), 2.0)
    said += [text for _, text in session.step(PilotCommand(), 2.0).news]
    assert sum("waits at" in text for text in said) == 1


def test_a_hold_that_costs_more_than_the_way_is_one_caution_until_it_ends(session: FlightSession) -> None:
    fly_until(session, "waits at", 900.0)
    arrived_m_s = session.craft.steering.propellant.delta_v_m_s
    session.clock.set_rate(200.0)
    said = fly_until(session, "has cost", 20000.0)
    text = said[-1]
    held_m_s = session.craft.steering.propellant.delta_v_m_s - arrived_m_s
    assert held_m_s > max(arrived_m_s, 0.5)
    assert text.startswith("holding at H1 has cost ")
    assert text.endswith(": Go or Free drift ends it")
    assert not session.is_over(text)
    later = [news for _ in range(20) for _, news in session.step(PilotCommand(), 0.1).news]
    assert not any("has cost" in news for news in later)
    session.order(Drift())
    assert session.is_over(text)
