"""Cautions of the flight: told once, when they begin."""

from dataclasses import replace

import msgspec
import pytest

from flyaround.simulator.piloting.orders import Centre, Drift
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.keep_out import KeepOut
from tests.harness.pilot import fly


def told(session, seconds, *held):
    return [text for _, text in fly(session, seconds, *held) if not text.startswith("the plume")]


def test_a_keep_out_sphere_that_overrules_is_told_once():
    scenario = load_scenario("tango-flyaround")
    chaser = msgspec.structs.replace(scenario.chaser, keep_out=KeepOut(radius_m=7.0))
    session = FlightSession.of(msgspec.structs.replace(scenario, chaser=chaser))
    session.order(Centre())
    news = told(session, 20.0, "forward", "coarse")
    # beside the caution of where the free drift leads
    assert sum("keep-out sphere" in text and "free drift" not in text for text in news) == 1


def test_an_eclipse_is_told_as_it_begins_and_ends():
    session = FlightSession.of(load_scenario("tango-flyaround"))
    session.clock.set_rate(100.0)
    news = told(session, 60.0)
    assert [text.split(":")[0] for text in news[:2]] in (
        ["eclipse", "the target is in sunlight again"],
        ["the target is in sunlight again", "eclipse"],
    )
    # looking back tells nothing again
    session.look_back.seek(0.0)
    session.clock.paused = False
    assert told(session, 5.0) == []


def test_a_flown_eclipse_is_kept_once():
    session = FlightSession.of(load_scenario("tango-eclipse-pass"))
    session.jump_to_event("eclipse")
    while session.clock.jump:
        fly(session, 0.1)
    session.clock.set_rate(100.0)
    fly(session, 1.0)
    ((start_s, end_s),) = session.eclipses_s
    lit = [session.flight.state(t_s).sun_visible_fraction > 0.0 for t_s in (start_s - 30.0, start_s, end_s)]
    assert lit == [True, False, False]
    assert end_s == session.t_s
    # flown again from before it, and beyond
    session.look_back.seek(start_s - 20.0)
    session.look_back.fly_on()
    session.clock.paused = False
    fly(session, 2.0)
    assert session.t_s > end_s
    ((again_s, until_s),) = session.eclipses_s
    assert again_s == pytest.approx(start_s, abs=0.2 * 100.0)
    assert until_s == session.t_s


def test_low_fuel_is_told_once():
    session = FlightSession.of(load_scenario("tango-flyaround"))
    session.craft.take_over()
    told(session, 0.1)
    spent = replace(session.craft.steering.propellant, used_kg=3.99)
    session.craft.steering.propellant = spent
    news = told(session, 3.0, "forward", "coarse")
    assert [text.split(":")[0] for text in news] == ["fuel is low"]


def test_a_chaser_at_rest_does_not_drift_away():
    session = FlightSession.of(load_scenario("tango-vbar-approach"))
    session.order(Drift())
    told(session, 0.1)
    chaser = session.craft.steered
    outward = tuple(5 * x for x in chaser.position_eci_m)
    session.craft.steered = replace(chaser, position_eci_m=outward, velocity_eci_m_s=(0.0, 0.0, 0.0))
    assert not [text for text in told(session, 0.1) if "drifts away" in text]
    moving = replace(session.craft.steered, velocity_eci_m_s=tuple(x / 100 for x in outward))
    session.craft.steered = moving
    assert [text for text in told(session, 0.1) if "drifts away" in text]


def test_a_discarded_approach_is_no_measure_of_a_drift():
    session = FlightSession.of(load_scenario("tango-vbar-approach"))
    session.order(Drift())
    session.clock.set_rate(10.0)
    told(session, 2.0)
    far = session.craft.steered
    session.craft.steered = replace(far, position_eci_m=tuple(0.1 * x for x in far.position_eci_m))
    told(session, 0.2)
    session.look_back.seek(1.0)
    session.order(Drift())
    session.look_back.fly_on()
    session.clock.paused = False
    chaser = session.craft.steered
    session.craft.steered = replace(chaser, velocity_eci_m_s=tuple(-x for x in chaser.velocity_eci_m_s))
    assert not [text for text in told(session, 2.0) if "drifts away" in text]
