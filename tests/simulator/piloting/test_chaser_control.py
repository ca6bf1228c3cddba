"""Steering without a window: axes, pulses, attitude modes, brake, abort, plume, propellant, high rates, contact."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2, PULSE_M_S, PULSE_RAD
from flyaround.simulator.piloting.docking_figures import docked_state
from flyaround.simulator.piloting.orders import Abort, Centre, Control, PilotCommand
from flyaround.simulator.piloting.propellant import Propellant, plume_strikes
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.attitude.target_attitude import Attitude
from flyaround.simulator.world.constants import G0_M_S2
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix, rotation_angle_rad
from flyaround.simulator.world.guidance.free_flight import FreeDrift
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.manual_control import ChaserState
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.orbit.propagation import propagate
from tests.harness.pilot import TICK_S, fly, holding


def session_at(
    position=(0.0, 30.0, 0.0),
    velocity=(0.0, 0.0, 0.0),
    keep_out=None,
):
    """Drifting beside a target at rest in LVLH."""
    scenario = msgspec.structs.replace(
        load_scenario("tango-flyaround"),
        attitude=Attitude(motion="fixed", frame="lvlh"),
        chaser=FreeDrift(position_lvlh_m=position, velocity_lvlh_m_s=velocity, keep_out=keep_out),
    )
    return FlightSession.of(scenario)


def off_boresight_deg(session):
    chaser = session.craft.chaser
    x, y, z = -matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.position_eci_m)
    return float(np.degrees(np.arctan2(np.hypot(x, y), z)))


def velocity_lvlh(session):
    return np.array(session.craft.world.velocity_lvlh_m_s)


@pytest.mark.parametrize(
    ("key", "direction"),
    [
        ("forward", (0, 1, 0)),
        ("back", (0, -1, 0)),
        ("up", (1, 0, 0)),
        ("down", (-1, 0, 0)),
        ("right", (0, 0, -1)),
        ("left", (0, 0, 1)),
    ],
)
def test_in_lvlh_axes_a_key_pushes_along_the_flight_whatever_the_camera_does(key, direction):
    session, coasting = session_at(), session_at()
    session.craft.steering.axes = "lvlh"
    coasting.craft.take_over()
    fly(session, 1.0, key)
    fly(coasting, 1.0)
    gained = velocity_lvlh(session) - velocity_lvlh(coasting)
    np.testing.assert_allclose(gained, ACCELERATION_M_S2 * np.array(direction, float), atol=2e-4)


def test_a_press_gives_one_pulse_however_long_it_is_held():
    session, coasting = session_at(), session_at()
    session.craft.steering.thrust = "pulse"
    coasting.craft.take_over()
    fly(session, 3.0, "forward")
    fly(coasting, 3.0)
    gained = velocity_lvlh(session) - velocity_lvlh(coasting)
    assert np.linalg.norm(gained) == pytest.approx(PULSE_M_S, rel=1e-3)
    assert session.craft.steering.propellant.delta_v_m_s == pytest.approx(PULSE_M_S, rel=1e-9)
    fly(session, 0.1)
    fly(session, 1.0, "forward", "fine")
    assert session.craft.steering.propellant.delta_v_m_s == pytest.approx(1.2 * PULSE_M_S, rel=1e-9)


def test_a_pulse_of_turn_turns_by_its_angle():
    session = session_at()
    session.craft.set_attitude("hold")
    session.craft.steering.thrust = "pulse"
    fly(session, 2.0)
    before = session.craft.chaser.q_camera_from_eci_wxyz
    fly(session, 2.0, "yaw-right")
    turned = rotation_angle_rad(before, session.craft.chaser.q_camera_from_eci_wxyz)
    assert turned == pytest.approx(PULSE_RAD, rel=0.05)


def test_rate_hold_keeps_the_rate_and_attitude_hold_the_attitude():
    session = session_at()
    session.craft.set_attitude("rate")
    fly(session, 1.0, "roll-right")
    fly(session, 0.5)
    rate = session.craft.chaser.omega_camera_rad_s
    assert np.degrees(rate[2]) == pytest.approx(2.0, abs=0.05)
    fly(session, 5.0)
    assert session.craft.chaser.omega_camera_rad_s == pytest.approx(rate)
    session.craft.set_attitude("hold")
    fly(session, 2.0)
    assert np.linalg.norm(session.craft.chaser.omega_camera_rad_s) < 1e-12
    held = session.craft.chaser.q_camera_from_eci_wxyz
    fly(session, 5.0)
    assert rotation_angle_rad(held, session.craft.chaser.q_camera_from_eci_wxyz) < 1e-9


def test_attitude_hold_in_lvlh_axes_keeps_the_attitude_beside_the_target():
    session = session_at()
    session.craft.set_attitude("hold")
    session.craft.steering.axes = "lvlh"
    fly(session, 2.0)

    def attitude():
        chaser = session.craft.chaser
        frame = session.flight.orbit.frame(chaser.t_s)
        return matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ frame.R_eci_from_lvlh

    before = attitude()
    session.clock.set_rate(1000.0)
    fly(session, 1.0)
    angle = np.arccos((np.trace(before.T @ attitude()) - 1) / 2)
    assert session.t_s > 900
    assert np.degrees(angle) < 0.05


def test_the_docking_attitude_is_taken_and_kept_beside_a_tumbling_target():
    session = FlightSession.of(load_scenario("tango-flyaround"))
    session.craft.set_attitude("dock")
    session.clock.set_rate(5.0)
    fly(session, 12.0)
    f = session.craft.docking.figures(session.craft.chaser, session.flight)
    assert max(abs(f.roll_deg), abs(f.pitch_deg), abs(f.yaw_deg)) < 0.01
    assert max(abs(f.roll_deg_s), abs(f.pitch_deg_s), abs(f.yaw_deg_s)) < 0.01


def test_a_thrust_key_ends_what_flew_and_says_so():
    session = session_at()
    session.craft.take_over()
    session.craft.steering.engage_autopilot()
    assert session.craft.steering.doing == "autopilot"
    news = fly(session, 0.1, "back")
    assert session.craft.steering.doing == ""
    assert news == [("note", "autopilot has ended: you push")]


def test_a_stick_pushes_in_shares_until_it_stops():
    session, coasting = session_at(), session_at()
    coasting.craft.take_over()
    session.step(PilotCommand(thrust=(0.0, 0.0, 0.5)), 1.0)
    session.step(PilotCommand(), 1.0)
    fly(coasting, 2.0)
    gained = velocity_lvlh(session) - velocity_lvlh(coasting)
    assert np.linalg.norm(gained) == pytest.approx(0.5 * ACCELERATION_M_S2, rel=0.01)


# --- what it costs


def test_propellant_by_the_rocket_equation():
    spent = Propellant(Thrusters(mass_kg=100.0, specific_impulse_s=220.0))
    for _ in range(2000):
        spent = spent.after(np.array([0.0, 0.0, 0.05]), 1.0)
    assert spent.delta_v_m_s == pytest.approx(100.0)
    assert spent.mass_kg == pytest.approx(100.0 * np.exp(-100.0 / (220.0 * G0_M_S2)), rel=1e-5)


def test_a_push_between_the_axes_burns_what_each_side_gives():
    along = Propellant(Thrusters()).after(np.array([0.05, 0.0, 0.0]), 1.0)
    between = Propellant(Thrusters()).after(np.array([0.05, 0.05, 0.0]) / np.sqrt(2), 1.0)
    assert between.delta_v_m_s == pytest.approx(along.delta_v_m_s)
    assert between.used_kg == pytest.approx(np.sqrt(2) * along.used_kg)


def looking_at_target(away_m):
    return ChaserState(
        t_s=0.0,
        position_eci_m=(0.0, 0.0, -away_m),
        velocity_eci_m_s=(0.0, 0.0, 0.0),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
    )


def test_braking_near_the_target_blows_at_it():
    back, forward, side = (np.array(a) for a in ((0, 0, -0.05), (0, 0, 0.05), (0.05, 0, 0.0)))
    assert plume_strikes(looking_at_target(10.0), back, 1.0)
    assert not plume_strikes(looking_at_target(10.0), forward, 1.0)
    assert not plume_strikes(looking_at_target(10.0), side, 1.0)
    assert not plume_strikes(looking_at_target(50.0), back, 1.0)
    # beside a large craft nothing but outward is clear
    assert plume_strikes(looking_at_target(6.0), side, 5.9)


def test_the_plume_is_told_once():
    session = session_at((0.0, 10.0, 0.0))
    news = fly(session, 1.0, "back")
    assert session.state.plume
    assert [level for level, _ in news] == ["caution"]
    fly(session, 0.1)
    assert not session.craft.steering.plume


def test_tracking_centres_the_target_and_turn_keys_put_it_beside_the_middle():
    session = session_at()
    session.order(Control(attitude="hold"))
    fly(session, 4.0, "yaw-right")
    assert off_boresight_deg(session) > 3.0
    session.order(Control(attitude="target"))
    fly(session, 10.0)
    assert off_boresight_deg(session) < 0.1
    assert session.craft.steering.attitude_text == "track target"
    fly(session, 2.0, "yaw-right")
    fly(session, 5.0)
    off_deg = off_boresight_deg(session)
    assert off_deg > 1.0
    assert session.craft.steering.attitude_text == f"track, {off_deg:.1f}° off"


# --- abort


def test_an_abort_pushes_outward_in_the_very_next_step():
    session = session_at((0.0, 10.0, 0.0), (0.0, -0.2, 0.0))
    session.craft.take_over()
    before = velocity_lvlh(session)[1]
    session.order(Abort())
    session.step(PilotCommand(), TICK_S)
    assert session.t_s == pytest.approx(TICK_S)
    assert velocity_lvlh(session)[1] > before + 0.2 * TICK_S


def test_an_abort_leaves_by_the_corridor_it_came_in_by():
    keep_out = KeepOut(radius_m=12.0, corridor_axis_lvlh=(0.0, 1.0, 0.0), corridor_half_angle_deg=15.0)
    session = session_at((0.4, 4.0, 0.3), (0.0, -0.15, 0.0), keep_out)
    session.craft.take_over()
    session.order(Abort())
    session.clock.set_rate(20.0)
    for _ in range(200):
        news = fly(session, 0.2)
        assert not keep_out.violated(np.array(session.craft.world.position_lvlh_m))
        if not session.craft.steering.aborting:
            break
    assert session.craft.world.range_m > 24.0
    assert news[-1] == ("caution", "the abort is done: the chaser drifts unguided")


def test_an_abort_stops_a_hurried_clock():
    session = session_at()
    session.clock.set_rate(500.0)
    session.clock.toggle_pause()
    session.order(Abort())
    assert (session.clock.rate, session.clock.paused, session.craft.mode) == (1.0, False, "steer")


@pytest.mark.parametrize("attitude", ["rate", "hold", "dock"])
def test_an_abort_points_the_camera_at_the_target(attitude):
    session = session_at((0.0, 10.0, 0.0), (0.0, -0.2, 0.0))
    session.order(Control(attitude=attitude))
    fly(session, 4.0, "yaw-right")
    assert off_boresight_deg(session) > 1.0
    level, text = session.order(Abort())
    assert (level, text.endswith("the camera tracks it")) == ("warning", True)
    fly(session, 20.0)
    assert off_boresight_deg(session) < 0.5
    assert session.craft.tracking


# --- high rates


@pytest.mark.parametrize("rate", [0.1, 10.0, 1000.0])
def test_free_flight_at_every_rate_is_the_worlds_own_propagation(rate):
    session = session_at((3.0, 400.0, 5.0), (0.01, -0.02, 0.005))
    session.craft.take_over()
    session.clock.set_rate(rate)
    fly(session, 5.0)
    chaser = session.craft.chaser
    flight = session.flight
    r, v = flight.orbit(0.0)
    start = flight.orbit.frame(0.0).to_eci(np.array([3.0, 400.0, 5.0]), np.array([0.01, -0.02, 0.005]))
    truth = propagate(r, v, session.t_s + 1.0, flight.orbit.forces, start)
    p, _ = truth.relative(chaser.t_s)
    assert chaser.t_s == pytest.approx(5.0 * rate, rel=0.01)
    np.testing.assert_allclose(chaser.position_eci_m, p, atol=1e-3)


def test_the_camera_keeps_the_target_at_a_thousand_times():
    session = session_at((0.0, 400.0, 50.0), (0.05, 0.0, 0.0))
    session.order(Centre())
    fly(session, 3.0)
    session.clock.set_rate(1000.0)
    for _ in range(20):
        fly(session, 0.1)
        f = session.craft.chaser
        los = -matrix_from_quat(f.q_camera_from_eci_wxyz) @ np.array(f.position_eci_m)
        assert np.degrees(np.arctan2(np.hypot(los[0], los[1]), los[2])) < 0.5


def test_pushing_at_a_thousand_times_does_not_drown_the_window():
    session = session_at((0.0, 300.0, 0.0))
    session.craft.take_over()
    session.clock.set_rate(1000.0)
    for _ in range(10):
        session.step(holding("up"), 0.05)
    # a thousand steps of a fifth of a second in a second
    assert session.t_s == pytest.approx(0.5 * 200.0, rel=0.02)


def test_a_flight_by_pulses_and_modes_does_not_depend_on_the_windows_rate():
    def flown(tick):
        session = session_at((0.0, 12.0, 0.0))
        session.craft.take_over()
        session.clock.set_rate(50.0)
        session.craft.steering.engage_autopilot()
        for _ in range(round(0.6 / tick)):
            session.step(PilotCommand(), tick)
        return session.craft.chaser

    assert flown(0.01) == flown(0.05)


# --- contact


def driven_in(speed, right=0.0):
    session = session_at((0.0, 30.0, 0.0))
    session.craft.take_over()
    session.craft.set_attitude("dock")
    attitude = session.flight.attitude(0.0)
    p, v, R_camera_from_eci, turn = docked_state(attitude, session.craft.docking.port)
    x, _, z = R_camera_from_eci
    session.craft.steered = ChaserState(
        t_s=0.0,
        position_eci_m=vec3(np.array(p) - 0.3 * z + right * x),
        velocity_eci_m_s=vec3(np.array(v) + speed * z),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R_camera_from_eci)),
        omega_camera_rad_s=turn,
    )
    return session


def test_a_soft_touch_at_the_port_is_a_docking_and_holds():
    session = driven_in(0.1)
    fly(session, 5.0)
    contact = session.craft.docking.contact
    assert contact is not None
    assert contact.docked
    assert contact.score > 90
    assert contact.t_s == pytest.approx(3.0, abs=0.05)
    assert session.craft.steering.doing == "docked"
    fly(session, 2.0)
    f = session.craft.docking.figures(session.craft.chaser, session.flight)
    assert (f.range_m, f.speed_m_s) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert (f.roll_deg_s, f.pitch_deg_s, f.yaw_deg_s) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    session.order(Abort())
    session.clock.set_rate(5.0)
    fly(session, 2.0)
    assert session.craft.docking.figures(session.craft.chaser, session.flight).axial_m > 0.5
    assert len(session.craft.docking.contacts) == 1


def test_a_hard_touch_is_judged_and_thrown_back():
    session = driven_in(0.6)
    news = fly(session, 2.0)
    contact = session.craft.docking.contact
    assert contact is not None
    assert not contact.docked
    assert contact.misses[0].startswith("closing 0.6")
    assert session.craft.docking.figures(session.craft.chaser, session.flight).closing_m_s < 0
    assert news[-1][0] == "warning"


def test_the_body_beside_the_port_is_no_port():
    session = driven_in(0.1, right=0.0)
    # through Tango's panel from the side: the docking point meets the hull, not the port's plane
    chaser = session.craft.steered
    assert chaser is not None
    away = np.array(chaser.position_eci_m)
    lvlh = session.flight.orbit.frame(0.0).R_eci_from_lvlh
    session.craft.steered = replace(
        chaser,
        position_eci_m=vec3(lvlh @ [2.5, 0.0, 0.0]),
        velocity_eci_m_s=vec3(lvlh @ [-0.3, 0.0, 0.0]),
        q_camera_from_eci_wxyz=quat(
            quat_from_matrix((lvlh @ np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]).astype(float)).T)
        ),
    )
    assert np.linalg.norm(away) > 1.0
    session.craft.set_attitude("hold")
    fly(session, 10.0)
    contact = session.craft.docking.contact
    assert contact is not None
    assert not contact.at_port
    assert contact.score == 0
    assert session.craft.world.range_m > 0.5
