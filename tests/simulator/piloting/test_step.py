"""Flights by `FlightSession.step` alone: an approach in closed loop, and a recorded flight that replays to the bit."""

import sys

import msgspec
import numpy as np
import pytest
from programs import completed

import flyaround as fa
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.orders import (
    Abort,
    Control,
    Drift,
    FollowGuidance,
    Go,
    JudgeBy,
    PlanBurn,
    Pulse,
    Stop,
)
from flyaround.simulator.piloting.planned_burns import burn_of
from flyaround.simulator.world.guidance.free_flight import FreeDrift

START_LVLH_M, GOAL_LVLH_M = (2.0, 30.0, -1.0), np.array([0.0, 15.0, 0.0])
# a damped approach of two and a half minutes, in units of the whole thrust
GAIN_1_S2, DAMPING_1_S, WHOLE_M_S2 = 0.002, 0.08, 0.05
TICK_S, END_S = 0.5, 200.0


def beside():
    return msgspec.structs.replace(
        fa.load_scenario("tango-flyaround"), chaser=FreeDrift(position_lvlh_m=START_LVLH_M)
    )


def approach_command(state):
    """Proportional and derivative control along LVLH axes: up, along the flight, and to the left of it."""
    p, v = np.array(state.world.position_lvlh_m), np.array(state.world.velocity_lvlh_m_s)
    radial, along, cross = np.clip((GAIN_1_S2 * (GOAL_LVLH_M - p) - DAMPING_1_S * v) / WHOLE_M_S2, -1.0, 1.0)
    return fa.PilotCommand(thrust=(-cross, -radial, along))


@pytest.fixture(scope="module")
def approach():
    session = fa.FlightSession.of(beside())
    commands = [fa.PilotCommand(orders=(Control(axes="lvlh", attitude="target"),))]
    states = [session.step(commands[0], TICK_S)]
    while states[-1].t_s < END_S - 1e-6:
        commands.append(approach_command(states[-1]))
        states.append(session.step(commands[-1], TICK_S))
    return states, commands


def test_an_approach_is_flown_by_step_alone(
    approach,
):
    states, _ = approach
    end = states[-1]
    assert end.mode == "steer"
    assert end.t_s == pytest.approx(END_S)
    np.testing.assert_allclose(end.world.position_lvlh_m, GOAL_LVLH_M, atol=0.1)
    assert np.linalg.norm(end.world.velocity_lvlh_m_s) < 0.01
    assert 0.2 < end.propellant.delta_v_m_s < 3.0
    assert end.attitude == "target"


def test_recorded_commands_replay_to_the_bit(
    approach,
):
    states, commands = (recorded[:100] for recorded in approach)
    again = fa.FlightSession.of(beside())
    for before, command in zip(states, commands, strict=True):
        after = again.step(command, TICK_S)
        assert (after.chaser, after.propellant, after.news) == (before.chaser, before.propellant, before.news)


def test_orders_are_carried_out_once_and_answered():
    session = fa.FlightSession.of(beside())
    state = session.step(fa.PilotCommand(orders=(PlanBurn(burn_of(5.0, 0.0, -0.05, 0.0)),)), TICK_S)
    assert state.news == (("note", "a burn of 0.0500 m/s is planned at T+00:00:05.0"),)
    news = [item for _ in range(20) for item in session.step(fa.PilotCommand(), TICK_S).news]
    assert news == [("note", "the burn of 0.0500 m/s at T+00:00:05.0 is flown")]
    state = session.step(fa.PilotCommand(), TICK_S)
    assert state.propellant.delta_v_m_s == pytest.approx(0.05, rel=1e-9)
    state = session.step(fa.PilotCommand(orders=(Stop(), Drift(), Pulse("forward"))), TICK_S)
    assert state.propellant.delta_v_m_s == pytest.approx(0.06, rel=1e-9)
    state = session.step(fa.PilotCommand(orders=(Abort(),)), TICK_S)
    level, text = state.news[0]
    assert level == "caution"
    assert text.startswith("abort: guidance and burns end, and the chaser drifts unguided: it is 29.8 m away")
    assert session.step(fa.PilotCommand(orders=(FollowGuidance(),)), TICK_S).mode == "guidance"


@pytest.mark.parametrize(
    "wrong",
    [
        {"thrust": (0.0, 0.0, 1.5)},
        {"turn": (0.0, float("nan"), 0.0)},
        {"thrust": (0.0, 1.0)},
        {"gain": 50.0},
        {"switches": frozenset({"sideways"})},
    ],
)
def test_a_demand_out_of_its_range_is_refused(wrong):
    with pytest.raises(ValueError, match="demand"):
        fa.PilotCommand(**wrong)


def test_an_order_that_cannot_be_carried_out_is_refused():
    session = fa.FlightSession.of(beside())
    with pytest.raises(UserError, match="no go at H1"):
        session.step(fa.PilotCommand(orders=(Go(),)), TICK_S)
    # and changes nothing
    assert session.craft.mode == "guidance"
    with pytest.raises(UserError, match="two-tenths"):
        session.step(fa.PilotCommand(orders=(JudgeBy("mine"),)), TICK_S)


def test_flying_imports_nothing_of_the_console():
    code = (
        "import sys, flyaround as fa; fa.FlightSession, fa.PilotCommand; "
        "print([m for m in sys.modules if 'flyaround.gui' in m or m == 'moderngl'])"
    )
    printed = completed(sys.executable, "-c", code, check=True)
    assert printed.stdout.strip() == "[]"
