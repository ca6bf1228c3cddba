"""Guidance modes from where the chaser is, planned burns and jumps, each against the world's own propagation."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.clock import JUMP_RATE
from flyaround.simulator.piloting.guidance_orders import (
    ApproachVbar,
    Circumnavigate,
    FlyAround,
    FlyGlideslope,
    FlySafeEllipse,
    FlyTo,
    KeepRange,
    KeepStation,
)
from flyaround.simulator.piloting.jumps import next_event_s, search_s, sun_fraction, sun_height
from flyaround.simulator.piloting.open_end import longer_flight
from flyaround.simulator.piloting.orders import FollowGuidance, PilotCommand
from flyaround.simulator.piloting.planned_burns import BURN_M_S2, BurnPlan, burn_of
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.free_flight import FreeDrift

TICK_S = 0.05


def session_at(position):
    scenario = msgspec.structs.replace(
        load_scenario("tango-flyaround"), chaser=FreeDrift(position_lvlh_m=position)
    )
    session = FlightSession.of(scenario)
    session.craft.take_over()
    return session


def begin(session, order):
    session.order(order)
    guided = session.craft.steering.guided
    assert guided is not None
    return guided


def fly_to(session, t_s, rate=50.0):
    session.clock.set_rate(rate)
    while session.t_s < t_s - 1e-6:
        session.step(PilotCommand(), TICK_S)


@pytest.mark.parametrize(
    ("order", "end"),
    [
        (ApproachVbar(8.0, 0.2), (0.0, 8.0, 0.0)),
        (FlyTo((0.0, 9.0, 5.0), 0.2), (0.0, 9.0, 5.0)),
        (FlyGlideslope(8.0), tuple(8.0 * np.array([2.0, 15.0, -1.0]) / 230**0.5)),
    ],
)
def test_a_path_is_flown_to_its_end(order, end):
    session = session_at((2.0, 15.0, -1.0))
    begin(session, order)
    fly_to(session, 450.0, 100.0)
    p, v = session.craft.state_lvlh()
    np.testing.assert_allclose(p, end, atol=0.05)
    assert np.linalg.norm(v) < 2e-3


def test_a_fly_around_goes_through_where_the_chaser_is():
    session = session_at((2.0, 15.0, -3.0))
    start = session.craft.state_lvlh()
    order = FlyAround(period_s=400.0)
    mode = order.mode(start, 1.0)
    np.testing.assert_allclose(mode.state_lvlh(0.0, 1e-3)[0], start[0], atol=1e-9)
    guided = begin(session, order)
    fly_to(session, guided.join_s + 400.0)
    np.testing.assert_allclose(session.craft.state_lvlh()[0], start[0], atol=0.3)


def test_a_natural_circumnavigation_needs_no_thrust_once_it_is_begun():
    session = session_at((5.0, 12.0, 0.0))
    guided = begin(session, Circumnavigate())
    start = session.craft.state_lvlh()[0]
    fly_to(session, guided.coasts_from_s + 2.0)
    spent = session.craft.steering.propellant.delta_v_m_s
    assert 0.005 < spent < 0.3
    period = 2 * np.pi / session.flight.n_rad_s
    turned = []
    while session.t_s < guided.coasts_from_s + period:
        fly_to(session, session.t_s + period / 8, 1000.0)
        turned.append(float(np.linalg.norm(session.craft.state_lvlh()[0])))
    assert session.craft.steering.propellant.delta_v_m_s == spent
    x, y, z = session.craft.state_lvlh()[0]
    assert np.hypot(x, y / 2) == pytest.approx(np.hypot(start[0], start[1] / 2), abs=1.0)
    assert abs(z) < 0.01
    assert min(turned) > 6.0


def test_a_safe_ellipse_keeps_clear_of_the_velocity_axis():
    session = session_at((5.0, 12.0, 0.0))
    guided = begin(session, FlySafeEllipse())
    fly_to(session, guided.coasts_from_s + 1.0)
    clear = []
    while session.t_s < guided.coasts_from_s + 2 * np.pi / session.flight.n_rad_s:
        fly_to(session, session.t_s + 100.0, 1000.0)
        p = session.craft.state_lvlh()[0]
        clear.append(float(np.hypot(p[0], p[2])))
    assert min(clear) > 0.9 * np.hypot(5.0, 6.0)


def test_range_keeping_turns_back():
    session = session_at((0.0, 15.0, 0.0))
    begin(session, KeepRange(10.0, 20.0))
    ranges = []
    for _ in range(8):
        fly_to(session, session.t_s + 100.0, 1000.0)
        ranges.append(float(np.linalg.norm(session.craft.state_lvlh()[0])))
    assert min(ranges) > 9.0
    assert max(ranges) < 21.0


@pytest.mark.parametrize(
    "order",
    [
        ApproachVbar(0.5),
        KeepStation((0.0, 1.0, 0.0)),
        FlyTo((-2.0, -15.0, 1.0)),
        FlyGlideslope(100.0),
        Circumnavigate(1.0),
        KeepRange(20.0, 30.0),
        KeepRange(15.0, 16.0),
    ],
)
def test_what_leads_into_the_target_or_nowhere_is_refused(order):
    state = session_at((2.0, 15.0, -1.0)).craft.state_lvlh()
    with pytest.raises(UserError):
        order.mode(state, 2.0)


# --- planned burns


def test_a_planned_burn_is_flown_on_time_and_to_where_it_was_foretold():
    session = session_at((0.0, 50.0, 0.0))
    steering = session.craft.steering
    steering.burns = steering.burns.with_burn(burn_of(100.0, 0.02, -0.05, 0.01), 0.0)
    steering.burns = steering.burns.with_burn(burn_of(700.0, 0.0, 0.04, 0.0), 0.0)
    told = session.craft.predicted_burns(after_s=300.0)
    assert told.nodes_lvlh_m.shape == (2, 3)
    fly_to(session, 98.0, 20.0)
    assert steering.propellant.delta_v_m_s == 0.0
    fly_to(session, 101.0, 20.0)
    assert steering.propellant.delta_v_m_s == pytest.approx(np.sqrt(0.0004 + 0.0025 + 0.0001), rel=1e-9)
    assert len(steering.burns.burns) == 1
    while session.t_s < 1000.0:
        fly_to(session, min(session.t_s + 20.0, 1000.0), 1000.0)
    assert steering.burns.burns == ()
    late = np.array([np.interp(session.t_s, told.times_s, told.points_lvlh_m[:, k]) for k in range(3)])
    np.testing.assert_allclose(session.craft.state_lvlh()[0], late, atol=0.2)


def test_burns_that_cannot_be_flown_are_refused():
    plan = BurnPlan().with_burn(burn_of(100.0, 0.0, 1.0, 0.0), 0.0)
    assert plan.burns[0].duration_s == pytest.approx(1.0 / BURN_M_S2)
    for wrong in (
        burn_of(5.0, 0.0, 1.0, 0.0),
        burn_of(105.0, 0.0, 1.0, 0.0),
        burn_of(200.0, 0.0, 0.0, 0.0),
        burn_of(2000.0, 0.0, 60.0, 0.0),
        burn_of(float("nan"), 0.0, 1.0, 0.0),
        burn_of(1e9, 0.0, 1.0, 0.0),
    ):
        with pytest.raises(UserError):
            plan.with_burn(wrong, 0.0)
    # at the same time it is another burn in its place
    assert plan.with_burn(burn_of(100.0, 0.0, 2.0, 0.0), 0.0).burns[0].size_m_s == 2.0
    for k in range(7):
        plan = plan.with_burn(burn_of(1000.0 + 100 * k, 0.1, 0.0, 0.0), 0.0)
    with pytest.raises(UserError, match="8 burns are planned already"):
        plan.with_burn(burn_of(5000.0, 0.1, 0.0, 0.0), 0.0)
    assert len(plan.without(1020.0).burns) == 7
    assert plan.without().burns == ()


# --- jumps


def test_events_of_the_sky_are_where_the_worlds_own_figures_change():
    session = FlightSession.of(load_scenario("tango-eclipse-pass"))
    flight = session.flight
    flight = longer_flight(session.plan, flight, (search_s(flight) + 10.0,), guided=True)
    dark = next_event_s(flight, "eclipse", 0.0)
    assert dark is not None
    assert flight.state(dark - 0.05).sun_visible_fraction > flight.state(dark + 1.0).sun_visible_fraction
    assert sun_fraction(flight, dark - 0.05) == pytest.approx(1.0, abs=1e-6)
    light = next_event_s(flight, "sunrise", dark)
    assert light is not None
    assert flight.state(light + 0.05).sun_visible_fraction == 1.0
    assert flight.state(light - 1.0).sun_visible_fraction < 1.0
    line = next_event_s(flight, "terminator", 0.0)
    assert line is not None
    assert abs(sun_height(flight, line)) < 1e-4


def test_a_jump_ends_at_its_moment_at_1x_and_goes_on():
    session = session_at((0.0, 100.0, 0.0))
    session.clock.set_rate(5.0)
    when = session.jump_to_event("terminator")
    while session.clock.jump:
        before = session.t_s
        session.step(PilotCommand(), TICK_S)
        assert session.t_s - before < 1.5 * TICK_S * JUMP_RATE
    assert session.t_s == pytest.approx(when, abs=0.25)
    assert (session.clock.rate, session.clock.paused) == (1.0, False)
    assert session.jump_to_event("terminator") > when + 60.0
    session.clock.set_rate(2.0)
    assert not session.clock.jump
    assert session.clock.rate == 2.0


def test_a_steered_flight_goes_on_without_its_guidance_and_comes_back_to_it():
    session = FlightSession.of(load_scenario("tango-vbar-approach"))
    whole = longer_flight(session.plan, session.flight, (1900.0,), guided=True)
    session.craft.take_over()
    session.clock.set_rate(1000.0)
    for _ in range(30):
        session.step(PilotCommand(), TICK_S)
    early = 100.0
    assert session.t_s > 1000.0
    # orbit and attitude of the whole span, the guidance's track as far as it was flown
    np.testing.assert_allclose(session.flight.orbit(1200.0)[0], whole.orbit(1200.0)[0], atol=1e-4)
    np.testing.assert_allclose(session.flight.attitude(1200.0)[0], whole.attitude(1200.0)[0], atol=1e-9)
    assert session.flight.chaser(early).position_eci_m == whole.chaser(early).position_eci_m
    session.order(FollowGuidance())
    np.testing.assert_allclose(
        session.craft.chaser.position_eci_m, whole.chaser(session.t_s).position_eci_m, atol=1e-4
    )


def test_an_orbit_without_eclipse_says_so():
    session = FlightSession.of(load_scenario("tango-night"))
    scenario = msgspec.structs.replace(session.plan.scenario, epoch_utc="2026-06-21T00:00:00Z")
    orbit = msgspec.structs.replace(scenario.orbit, raan_deg=180.0, inclination_deg=98.2, altitude_km=1400.0)
    session = FlightSession.of(msgspec.structs.replace(scenario, orbit=orbit))
    try:
        when = session.jump_to_event("eclipse")
    except UserError as error:
        assert "the next two orbits contain no time" in str(error)  # noqa: PT017
    else:
        assert session.flight.state(when + 0.5).sun_visible_fraction < 1.0


def test_a_hold_point_is_jumped_to_by_the_autopilot_alone():
    session = session_at((0.0, 30.0, 0.0))
    with pytest.raises(UserError, match="engage the autopilot"):
        session.jump_to_hold_point()


def test_the_phase_before_a_path_names_its_start_only_if_that_is_away():
    session = session_at((0.0, -10.0, 0.0))
    begin(session, FlyTo((0.0, -10.59, 0.0)))
    guided = session.craft.steering.guided
    assert guided.phase(session.t_s) == "matching speed"
    assert guided.phase(session.t_s + guided.join_s + 1.0) != "matching speed"
    begin(session, FlyAround(circle_m=16.0))
    assert session.craft.steering.guided.phase(session.t_s) == "flying to its start, 6.0 m away"
