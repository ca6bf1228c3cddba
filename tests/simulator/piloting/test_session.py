"""The operator's session without a window: clock, rates, steering, restart, what is asked to be drawn."""

import pickle
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.clock import RATES, STEP_S
from flyaround.simulator.piloting.control_laws import (
    ACCELERATION_M_S2,
    BRAKE_M_S2,
    COARSE_GAIN,
    RATE_RAD_S,
    SLEW_RAD_S2,
    THRUST,
    TURN,
)
from flyaround.simulator.piloting.docking_figures import IDSS, judge_contact
from flyaround.simulator.piloting.guidance_orders import (
    ApproachVbar,
    Circumnavigate,
    FlyAround,
    FlyGlideslope,
    FlyTo,
    KeepRange,
    KeepStation,
)
from flyaround.simulator.piloting.orders import (
    Approach,
    CancelBurns,
    Centre,
    FollowGuidance,
    Go,
    PilotCommand,
    PlanBurn,
    Pulse,
    Stop,
    TakeOver,
)
from flyaround.simulator.piloting.planned_burns import burn_of
from flyaround.simulator.piloting.session import FRAME_STEP_S, FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.thrusters import Thrusters
from tests.harness.pilot import TICK_S, fly, holding


@pytest.fixture
def session():
    return FlightSession.of(load_scenario("tango-flyaround"))


def off_boresight_deg(session):
    world = session.craft.world
    x, y, z = -matrix_from_quat(world.q_camera_from_eci_wxyz) @ np.array(world.relative_eci_m)
    return float(np.degrees(np.arctan2(np.hypot(x, y), z)))


def camera_velocity(session):
    chaser = session.craft.chaser
    return matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.velocity_eci_m_s)


def test_pause_freezes_time_and_the_picture(session):
    fly(session, 1.0)
    session.clock.toggle_pause()
    before = session.scene()
    fly(session, 5.0)
    assert session.scene() == before
    session.clock.toggle_pause()
    fly(session, 1.0)
    assert session.t_s == pytest.approx(2.0)


@pytest.mark.parametrize("rate", RATES)
def test_simulated_time_runs_at_the_rate(session, rate):
    session.clock.set_rate(rate)
    fly(session, 2.0)
    assert session.t_s == pytest.approx(2.0 * rate, abs=1.01 * STEP_S * rate)


def test_faster_and_slower_stop_at_the_ends(session):
    for _ in range(20):
        session.clock.shift_rate(1)
    assert session.clock.rate == RATES[-1]
    for _ in range(20):
        session.clock.shift_rate(-1)
    assert session.clock.rate == RATES[0]


def test_a_rate_that_is_not_offered_is_refused(session):
    with pytest.raises(ValueError, match="not one of"):
        session.clock.set_rate(3.0)


def test_one_frame_advances_once_and_stays_paused(session):
    session.step_frame()
    assert session.clock.paused
    assert session.t_s == pytest.approx(FRAME_STEP_S)
    fly(session, 1.0)
    assert session.t_s == pytest.approx(FRAME_STEP_S)


def test_guidance_is_the_scenarios_own_flight(session):
    fly(session, 3.0)
    expected = session.plan.flight.state(session.t_s)
    assert session.craft.mode == "guidance"
    assert session.craft.world == expected


def test_the_first_key_takes_over_without_a_jump(session):
    fly(session, 2.0)
    before = session.craft.chaser
    session.clock.toggle_pause()
    session.step(holding("forward"), TICK_S)
    assert session.craft.mode == "steer"
    assert session.craft.chaser == before


@pytest.mark.parametrize("action", list(THRUST))
def test_a_thrust_key_accelerates_along_its_camera_axis(session, action):
    coasting = FlightSession.of(session.plan.scenario)
    for one in (session, coasting):
        one.craft.take_over()
    seconds = 0.4
    fly(session, seconds, action)
    fly(coasting, seconds)
    gained = camera_velocity(session) - camera_velocity(coasting)
    direction = np.array(THRUST[action])
    assert gained @ direction == pytest.approx(ACCELERATION_M_S2 * seconds, rel=0.02)
    # the camera turns by half a degree meanwhile, so a little shows across the axis
    assert np.linalg.norm(gained - (gained @ direction) * direction) < 0.03 * ACCELERATION_M_S2 * seconds


@pytest.mark.parametrize("action", list(TURN))
def test_a_turn_key_turns_the_camera_about_its_axis(session, action):
    session.craft.take_over()
    session.craft.set_attitude("hold")
    assert not session.craft.tracking
    fly(session, 1.0, action)
    rate = np.array(session.craft.chaser.omega_camera_rad_s)
    np.testing.assert_allclose(rate, RATE_RAD_S * np.array(TURN[action]), atol=1e-12)


@pytest.mark.parametrize(
    ("action", "axis", "sign"),
    [
        ("yaw-right", 0, -1),
        ("yaw-left", 0, 1),
        ("pitch-up", 1, 1),
        ("pitch-down", 1, -1),
    ],
)
def test_the_target_moves_the_other_way_in_the_picture(session, action, axis, sign):
    before = np.array(session.scene().t_camera_from_target_m)
    fly(session, 1.5, action)
    moved = np.array(session.scene().t_camera_from_target_m) - before
    # three degrees at nine metres
    assert sign * moved[axis] == pytest.approx(
        np.tan(1.5 * RATE_RAD_S) * session.craft.world.range_m, rel=0.1
    )
    assert abs(moved[1 - axis]) < 0.1


def test_coarse_key_is_five_times_as_strong(session):
    other = FlightSession.of(session.plan.scenario)
    for one in (session, other):
        one.craft.take_over()
        one.order(Stop())
        fly(one, 6.0)
    fly(session, 0.2, "back")
    fly(other, 0.2, "back", "coarse")
    ratio = np.linalg.norm(other.craft.world.velocity_lvlh_m_s) / np.linalg.norm(
        session.craft.world.velocity_lvlh_m_s
    )
    assert ratio == pytest.approx(COARSE_GAIN, rel=0.05)


def test_stop_brings_the_chaser_to_rest_in_lvlh(session):
    speed = np.linalg.norm(session.craft.world.velocity_lvlh_m_s)
    session.order(Stop())
    fly(session, float(speed) / BRAKE_M_S2 + 1.0)
    assert not session.craft.steering.braking
    assert np.linalg.norm(session.craft.world.velocity_lvlh_m_s) < 3e-4


def test_tracking_keeps_the_target_in_the_middle_while_thrusting(session):
    fly(session, 4.0, "right")
    assert session.craft.tracking
    assert off_boresight_deg(session) < 0.1


def test_tracking_brings_a_lost_target_back(session):
    fly(session, 2.0, "yaw-right")
    assert off_boresight_deg(session) > 2.0
    session.order(Centre())
    fly(session, 8.0)
    assert off_boresight_deg(session) < 0.1


def test_the_rate_changes_no_faster_than_the_slew(session):
    session.craft.take_over()
    session.craft.set_attitude("hold")
    before = np.array(session.craft.chaser.omega_camera_rad_s)
    session.step(holding("yaw-left"), TICK_S)
    change = np.linalg.norm(np.array(session.craft.chaser.omega_camera_rad_s) - before)
    assert change == pytest.approx(SLEW_RAD_S2 * STEP_S, rel=1e-6)


def test_restart_gives_the_first_picture_again(session):
    first = session.scene()
    fly(session, 2.0, "forward", "roll-left")
    session.restart()
    assert session.scene() == first
    assert session.craft.mode == "guidance"
    assert len(session.look_back.trail.points) == 1


def test_reset_puts_the_chaser_back_and_keeps_steering(session):
    fly(session, 3.0, "back")
    session.order(FollowGuidance(steered=True))
    assert session.craft.mode == "steer"
    assert session.craft.world == session.flight.state(session.t_s)


def test_the_flight_goes_on_past_the_scenarios_end(session):
    down = session.flight.pointing
    session.clock.set_rate(100.0)
    early = session.craft.world.r_target_eci_m
    fly(session, 1.0)
    assert session.t_s > session.plan.scenario.duration_s
    assert session.flight.pointing == down
    session.restart()
    np.testing.assert_allclose(session.craft.world.r_target_eci_m, early, atol=1e-6)


def guarded_session(radius_m):
    scenario = load_scenario("tango-flyaround")
    thrusters = Thrusters()
    chaser = msgspec.structs.replace(
        scenario.chaser, keep_out=KeepOut(radius_m=radius_m), thrusters=thrusters
    )
    return FlightSession.of(msgspec.structs.replace(scenario, chaser=chaser))


def test_keep_out_sphere_stops_an_operator_who_pushes_on():
    session = guarded_session(7.0)
    session.order(Centre())
    ranges, guarded = [], False
    for _ in range(20):
        fly(session, 1.0, "forward", "coarse")
        ranges.append(session.craft.world.range_m)
        guarded = guarded or session.craft.steering.guarded
    assert guarded
    assert min(ranges) > 6.95
    free = FlightSession.of(load_scenario("tango-flyaround"))
    free.order(Centre())
    fly(free, 9.0, "forward", "coarse")
    assert free.craft.world.range_m < 7.0


def test_an_approach_that_the_keep_out_sphere_will_stop_is_a_caution_from_the_start():
    """Tango tumbles before a corridor along V-bar; a port that keeps its place in LVLH is let in."""
    tumbling = load_scenario("tango-vbar-approach")
    news = FlightSession.of(tumbling).order(Approach())
    assert news[0] == "caution"
    assert "the keep-out sphere of 12 m stops the chaser" in news[1]
    assert "corridor of 15°" in news[1]
    free = msgspec.structs.replace(tumbling, chaser=msgspec.structs.replace(tumbling.chaser, keep_out=None))
    assert FlightSession.of(free).order(Approach())[0] == "note"
    still = load_scenario(str(Path(__file__).parents[3] / "examples" / "docking.toml"))
    assert FlightSession.of(still).order(Approach())[0] == "note"


def test_hold_points_and_a_contact_are_marked_and_stay_when_one_looks_back():
    session = FlightSession.of(load_scenario("tango-vbar-approach"))
    session.order(Approach())
    fly(session, 0.4)
    docking = session.craft.docking
    figures = docking.figures(session.craft.chaser, session.flight)
    for point in docking.hold_points.points:
        docking.hold_points.watch(replace(figures, axial_m=0.5 * point.axial_m, right_m=0.0, down_m=0.0))
        fly(session, 0.4)
    docking.contacts.append(
        judge_contact(docking.figures(session.craft.chaser, session.flight), IDSS, at_port=True)
    )
    fly(session, 0.2)
    names = [m.text.partition(",")[0] for m in session.marks]
    count = len(session.craft.docking.hold_points.points)
    assert names == [*(f"H{k}" for k in range(1, count + 1)), "contact"]
    assert [m.t_s for m in session.marks] == sorted(m.t_s for m in session.marks)
    assert session.marks[-1].t_s == session.craft.docking.contacts[0].t_s
    before, middle_s = list(session.marks), (session.marks[0].t_s + session.marks[1].t_s) / 2
    session.look_back.seek(middle_s)
    session.clock.paused = True
    fly(session, 0.04)
    assert session.marks == before
    # what was flown after the place where one flies on is discarded
    session.look_back.fly_on()
    session.clock.paused = False
    fly(session, 0.04)
    assert session.marks == before[:1]
    # and comes back with the other future, which is exchanged as often as one likes
    session.look_back.swap_future()
    assert session.marks == before
    session.clock.paused = True
    fly(session, 0.04)
    assert session.marks == before
    session.look_back.swap_future()
    assert session.marks == before[:1]
    session.look_back.swap_future()
    session.restart()
    assert session.marks == []
    session.look_back.swap_future()
    assert session.marks == before


@pytest.mark.parametrize("jumps", [False, True])
def test_time_slows_down_at_a_contact_and_says_so(jumps):
    session = FlightSession.of(load_scenario("tango-space-10m"))
    session.order(TakeOver())
    # straight at the target
    p = np.array(session.craft.steered.position_eci_m)
    session.craft.steered = replace(
        session.craft.steered, velocity_eci_m_s=tuple(-0.5 * p / np.linalg.norm(p))
    )
    if jumps:
        session.clock.start_jump("event", 3000.0)
    else:
        session.clock.set_rate(50.0)
    session.step(PilotCommand(), 0.0)
    news: list[tuple[str, str]] = []
    while not session.craft.docking.contacts and session.t_s < 100.0:
        news += session.step(PilotCommand(), 0.02).news
    assert (session.clock.rate, session.clock.jump) == (1.0, "")
    assert [text.endswith("; time runs at 1x again") for _, text in news if "without docking" in text] == [
        True
    ]
    # a rate chosen after the contact stays
    session.clock.set_rate(10.0)
    fly(session, 1.0)
    assert session.clock.rate == 10.0


REFUSED = (
    FlyTo((0.0, 0.0, 0.0)),
    KeepStation((0.5, 0.0, 0.0)),
    FlyGlideslope(end_m=5000.0),
    KeepRange(near_m=1000.0, far_m=2000.0),
    KeepStation((float("nan"), 20.0, 0.0)),
    ApproachVbar(hold_m=float("nan")),
    ApproachVbar(speed_m_s=0.0),
    FlyAround(period_s=-900.0),
    FlyTo((5.0, 20.0, 0.0), float("inf")),
    Circumnavigate(float("inf")),
    PlanBurn(burn_of(0.0, 0.0, 1.0, 0.0)),
    PlanBurn(burn_of(float("nan"), 0.0, 1.0, 0.0)),
    PlanBurn(burn_of(60.0, float("nan"), 1.0, 0.0)),
    PlanBurn(burn_of(2e6, 0.0, 1.0, 0.0), 60.0),
    Pulse("sideways"),
    Go(),
)


@pytest.mark.parametrize("order", REFUSED, ids=lambda o: type(o).__name__)
@pytest.mark.parametrize("flown_by", ["guidance", "station keeping"])
def test_a_refused_order_changes_nothing(session, order, flown_by):
    fly(session, 1.0)
    if flown_by != "guidance":
        session.order(KeepStation())
        session.order(PlanBurn(burn_of(60.0, 0.0, 0.01, 0.0)))
    before, controls = session.state, pickle.dumps(session.craft.controls())
    with pytest.raises(UserError):
        session.order(order)
    assert session.state == before
    assert pickle.dumps(session.craft.controls()) == controls
    session.look_back.seek(0.3)
    with pytest.raises(UserError):
        session.order(order)
    assert session.look_back.active
    assert not session.look_back.changed


@pytest.mark.parametrize("dt_s", [float("nan"), float("inf"), -1.0])
def test_a_step_without_end_is_refused(session, dt_s):
    before = session.t_s
    with pytest.raises(UserError, match="a step of"):
        session.step(PilotCommand(orders=(KeepStation(),)), dt_s)
    assert session.t_s == before
    assert session.craft.steered is None
    session.clock.rate = float("nan")
    with pytest.raises(UserError, match="rate nan"):
        session.step(PilotCommand(), 1.0)


def test_a_moved_burn_replaces_the_planned_one(session):
    session.order(PlanBurn(burn_of(60.0, 0.0, 0.01, 0.0)))
    session.order(PlanBurn(burn_of(90.0, 0.0, 0.02, 0.0), 60.0))
    assert [b.t_s for b in session.craft.steering.burns.burns] == [90.0]
    session.order(CancelBurns())
    session.order(KeepStation())
    level, text = session.order(PlanBurn(burn_of(90.0, 0.0, 0.02, 0.0)))
    assert level == "caution"
    assert "station keeping would undo it: choose Free drift first" in text


def test_a_return_to_guidance_says_how_far_the_chaser_is_moved(session):
    assert session.order(FollowGuidance()) is None
    session.order(Stop())
    fly(session, 20.0)
    there = np.array(session.craft.chaser.position_eci_m)
    _, text = session.order(FollowGuidance())
    assert f"{np.linalg.norm(session.craft.chaser.position_eci_m - there):.1f} m" in text


def test_stop_says_that_it_does_not_hold_and_a_long_drift_is_a_caution(session):
    session.order(Pulse("left"))
    fly(session, 1.0)
    session.order(Stop())
    news = []
    while session.craft.steering.braking:
        news += session.step(holding(), TICK_S).news
    news += session.step(holding(), TICK_S).news
    assert ("note", "at rest; it drifts from here: Station keeping holds") in news
    session.order(PlanBurn(burn_of(session.t_s + 15.0, 0.0, 1.0, 0.0)))
    session.clock.set_rate(5.0)
    news = []
    for _ in range(1000):
        news += session.step(holding(), TICK_S).news
    assert any(text.startswith("the burn of 1.0000 m/s") and text.endswith("is flown") for _, text in news)
    (away,) = [text for level, text in news if "drifts away" in text]
    assert away.endswith("m from the target, without guidance")
