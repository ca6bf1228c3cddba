"""Docking figures against a chaser put where they are known, limits, contact and its score, hold points."""

from dataclasses import replace
from functools import lru_cache

import msgspec
import numpy as np
import pytest

from flyaround.simulator.piloting.docking_figures import (
    IDSS,
    PROBE_M,
    TWO_TENTHS,
    DockingFigures,
    docked_state,
    docking_figures,
    judge,
    judge_contact,
    touches_port,
)
from flyaround.simulator.piloting.docking_port import docking_port, port_along, radius_m, target_from_lvlh
from flyaround.simulator.piloting.docking_watch import Docking
from flyaround.simulator.piloting.hold_points import HoldPoints, not_ready
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
)
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.manual_control import ChaserState
from flyaround.simulator.world.guidance.paths import (
    Glideslope,
    Hold,
    RbarApproach,
    VbarApproach,
    Waypoints,
    approach_axis_lvlh,
)

REST = DockingFigures(
    t_s=0.0,
    axial_m=10.0,
    closing_m_s=0.0,
    right_m=0.0,
    down_m=0.0,
    right_m_s=0.0,
    down_m_s=0.0,
    roll_deg=0.0,
    pitch_deg=0.0,
    yaw_deg=0.0,
    roll_deg_s=0.0,
    pitch_deg_s=0.0,
    yaw_deg_s=0.0,
)


@lru_cache
def plan_of(name):
    return plan_flight(load_scenario(name), n=1)


def chaser_before(plan, offset, rotvec_deg=(0.0, 0.0, 0.0)):
    """A docked chaser moved along the port's axes, at rest to the target, then turned about its docking point."""
    attitude = plan.flight.attitude(0.0)
    port = docking_port(plan.target, plan.flight)
    p, _, R_camera_from_eci, _ = docked_state(attitude, port)
    R_eci_from_target = matrix_from_quat(attitude[0])
    moved = R_eci_from_target @ matrix_from_quat(port.q_target_from_port_wxyz) @ np.array(offset)
    turned = quat_multiply(quat_from_rotvec(-np.radians(rotvec_deg)), quat_from_matrix(R_camera_from_eci))
    tip = np.array(p) + R_camera_from_eci.T @ np.array(PROBE_M) + moved
    place = tip - matrix_from_quat(turned).T @ np.array(PROBE_M)
    spin = R_eci_from_target @ attitude[1]
    return ChaserState(
        t_s=0.0,
        position_eci_m=vec3(place),
        velocity_eci_m_s=vec3(np.cross(spin, place)),
        q_camera_from_eci_wxyz=quat(turned),
        omega_camera_rad_s=vec3(matrix_from_quat(turned) @ spin),
    )


@pytest.mark.parametrize("name", ["tango-flyaround", "iss-orbit-limb"])
def test_figures_of_a_chaser_that_was_put_there(name):
    plan = plan_of(name)
    port = docking_port(plan.target, plan.flight)
    chaser = chaser_before(plan, (0.3, -0.2, -12.0), (0.0, 2.0, 0.0))
    f = docking_figures(chaser, plan.flight.attitude(0.0), port)
    assert (f.axial_m, f.right_m, f.down_m) == pytest.approx((12.0, 0.3, -0.2), abs=1e-9)
    assert (f.roll_deg, f.pitch_deg, f.yaw_deg) == pytest.approx((0.0, 0.0, 2.0), abs=1e-9)
    # at rest to the target, however that turns
    assert f.speed_m_s == pytest.approx(0.0, abs=1e-9)
    assert (f.roll_deg_s, f.pitch_deg_s, f.yaw_deg_s) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert f.off_axis_deg == pytest.approx(np.degrees(np.arctan2(np.hypot(0.3, 0.2), 12.0)))


@pytest.mark.parametrize(
    ("rotvec_deg", "roll", "pitch", "yaw"),
    [((3, 0, 0), 0, 3, 0), ((0, 4, 0), 0, 0, 4), ((0, 0, 5), 5, 0, 0), ((0, 0, -170), -170, 0, 0)],
)
def test_angles_are_clockwise_up_and_right(rotvec_deg, roll, pitch, yaw):
    plan = plan_of("tango-flyaround")
    port = docking_port(plan.target, plan.flight)
    f = docking_figures(chaser_before(plan, (0, 0, -5), rotvec_deg), plan.flight.attitude(0.0), port)
    assert (f.roll_deg, f.pitch_deg, f.yaw_deg) == pytest.approx((roll, pitch, yaw), abs=1e-6)


def test_rates_are_derivatives_of_the_figures():
    plan = plan_of("tango-flyaround")
    flight, port = plan.flight, docking_port(plan.target, plan.flight)
    h = 1e-3
    before, now, after = (
        docking_figures(flight.chaser(20.0 + k * h), flight.attitude(20.0 + k * h), port) for k in (-1, 0, 1)
    )
    for value, rate, sign in (
        ("axial_m", "closing_m_s", -1),
        ("right_m", "right_m_s", 1),
        ("down_m", "down_m_s", 1),
    ):
        slope = (getattr(after, value) - getattr(before, value)) / (2 * h)
        assert getattr(now, rate) == pytest.approx(sign * slope, abs=1e-6)


def test_a_model_with_a_port_is_docked_with_there():
    plan = plan_of("iss-orbit-limb")
    port = docking_port(plan.target, plan.flight)
    origin, axis = plan.target.frames["docking"]
    np.testing.assert_allclose(port.axis_target, axis, atol=1e-12)
    # the Soyuz has a probe, 0.4 m before its rim
    tip = np.array(port.origin_m) + plan.target.mass.com_m - origin
    np.testing.assert_allclose(tip, 0.414 * np.array(axis), atol=0.01)


def test_without_a_port_the_axis_of_approach_leaves_the_body_there():
    plan = plan_of("tango-vbar-closed-loop")
    port = docking_port(plan.target, plan.flight)
    axis = target_from_lvlh(plan.flight, 0.0) @ [0.0, 1.0, 0.0]
    np.testing.assert_allclose(port.axis_target, axis, atol=1e-12)
    np.testing.assert_allclose(np.cross(port.origin_m, axis), 0.0, atol=1e-6)
    assert 0.1 < np.linalg.norm(port.origin_m) < radius_m(plan.target)


def test_the_axis_is_the_corridors_or_that_of_the_hold_point():
    hold = Hold(position_lvlh_m=(0.0, 0.0, -4.0))
    assert approach_axis_lvlh(hold) == (0.0, 0.0, -1.0)
    guarded = msgspec.structs.replace(
        hold, keep_out=KeepOut(radius_m=10.0, corridor_axis_lvlh=(-2.0, 0.0, 0.0))
    )
    assert approach_axis_lvlh(guarded) == (-1.0, 0.0, 0.0)
    assert approach_axis_lvlh(
        Waypoints(points_lvlh_m=[(9.0, 0.0, 0.0), (0.0, -3.0, 0.0)], speed_m_s=0.1)
    ) == (0.0, -1.0, 0.0)
    assert approach_axis_lvlh(plan_of("tango-flyaround").scenario.chaser) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("path", "axis"),
    [
        (RbarApproach(start_m=-50.0, hold_m=0.0, speed_m_s=0.1), (-1.0, 0.0, 0.0)),
        (RbarApproach(start_m=-50.0, hold_m=-0.5, speed_m_s=0.1), (-1.0, 0.0, 0.0)),
        (VbarApproach(start_m=-50.0, hold_m=0.0, speed_m_s=0.1), (0.0, -1.0, 0.0)),
        (
            Glideslope(start_lvlh_m=(0.0, 0.0, 7.0), end_lvlh_m=(0.0, 0.0, 0.0), start_m_s=0.2, end_m_s=0.1),
            (0.0, 0.0, 1.0),
        ),
        (
            Waypoints(points_lvlh_m=[(0.0, 9.0, 0.0), (0.0, 0.0, -3.0), (0.0, 0.0, 0.0)], speed_m_s=0.1),
            (0.0, 0.0, -1.0),
        ),
        (Hold(position_lvlh_m=(0.0, 0.0, 0.0)), (0.0, 1.0, 0.0)),
    ],
)
def test_the_axis_of_a_path_to_the_centre_is_the_side_that_it_comes_from(path, axis):
    assert approach_axis_lvlh(path) == axis


def test_a_docked_camera_has_the_earth_below_where_it_can():
    plan = plan_of("tango-flyaround")
    R = target_from_lvlh(plan.flight, 0.0)
    port = port_along(plan.target, R @ [0.0, 0.0, 1.0], R, plan.flight)
    down = matrix_from_quat(port.q_target_from_port_wxyz)[:, 1]
    np.testing.assert_allclose(down, R @ [-1.0, 0.0, 0.0], atol=1e-12)


def test_a_figure_is_within_near_or_outside_its_limit():
    f = replace(REST, axial_m=0.0, roll_deg=0.19, pitch_deg=-0.3, yaw_deg=0.5, closing_m_s=0.2)
    states = {row.name: row.state for row in judge(f, TWO_TENTHS)}
    assert (states["roll"], states["pitch"], states["yaw"]) == ("within", "near", "outside")
    assert states["closing"] == "within"


def test_far_away_one_may_be_quicker_and_farther_off_the_axis():
    f = replace(REST, axial_m=200.0, closing_m_s=0.9, right_m=3.5)
    assert {row.state for row in judge(f, TWO_TENTHS)} == {"within"}
    assert {r.name: r.state for r in judge(replace(f, axial_m=20.0), TWO_TENTHS)}["closing"] == "outside"


def test_the_corridor_is_a_figure_until_the_port_itself():
    off = replace(REST, right_m=3.0)
    assert judge(off, TWO_TENTHS, 10.0)[-1].state == "near"
    assert judge(replace(REST, axial_m=0.1, right_m=0.15), TWO_TENTHS, 10.0)[-1].state == "within"


def test_a_perfect_touch_and_one_at_its_limits():
    good = judge_contact(replace(REST, axial_m=0.0, closing_m_s=0.05), TWO_TENTHS, at_port=True)
    assert good.docked
    assert good.score == 99
    edge = {name: 0.2 for name in vars(REST) if name not in {"t_s", "axial_m"}}
    poor = judge_contact(replace(REST, axial_m=0.0, **edge), TWO_TENTHS, at_port=True)
    assert poor.docked
    assert poor.score == 50


def test_a_touch_out_of_limits_says_what_was_wrong():
    bad = judge_contact(replace(REST, axial_m=0.0, closing_m_s=0.5, yaw_deg=-1.0), TWO_TENTHS, at_port=True)
    assert not bad.docked
    assert bad.misses == ("closing 0.5000 m/s (limit 0.2)", "yaw 1 ° (limit 0.2)")
    assert bad.document()["docked"] is False
    beside = judge_contact(REST, TWO_TENTHS, at_port=False)
    assert (beside.score, beside.docked) == (0, False)


def test_a_standard_that_needs_a_closing_speed_refuses_a_slower_touch():
    slow = judge_contact(replace(REST, axial_m=0.0, closing_m_s=0.02), IDSS, at_port=True)
    assert slow.misses == ("closing 0.0200 m/s (at least 0.05)",)
    assert judge_contact(
        replace(REST, axial_m=0.0, closing_m_s=0.07, roll_deg=3.0), IDSS, at_port=True
    ).docked


def test_contact_is_where_the_plane_of_the_port_is_crossed():
    out, inside = replace(REST, axial_m=0.01), replace(REST, axial_m=-0.01)
    assert touches_port(out, inside)
    assert not touches_port(inside, out)
    assert not touches_port(out, replace(inside, right_m=2.0))
    assert not touches_port(inside, inside)


def test_hold_points_wait_for_a_go():
    points = HoldPoints(60.0)
    assert [p.axial_m for p in points.points] == [50.0, 20.0, 10.0, 5.0]
    at = replace(REST, axial_m=50.5)
    assert points.next is not None
    assert points.go(replace(at, closing_m_s=0.3), TWO_TENTHS) == (
        "moving at 0.3000 m/s",
        "closing +0.3000 m/s",
    )
    assert points.go(replace(at, axial_m=55.0), TWO_TENTHS) == ("5.0 m before H1",)
    assert points.next.decision == "open"
    assert points.no_go() == replace(points.points[0], decision="open")
    assert points.next.decision == "no-go"
    assert points.go(at, TWO_TENTHS) == ()
    assert points.next.axial_m == 20.0


def test_a_point_that_was_flown_past_is_passed():
    points = HoldPoints(25.0)
    assert points.watch(replace(REST, axial_m=19.5)) is None
    passed = points.watch(replace(REST, axial_m=15.0))
    assert passed is not None
    assert passed.name == "H1"
    assert [p.decision for p in points.points] == ["passed", "open", "open"]
    assert not_ready(points.points[1], replace(REST, axial_m=10.0), TWO_TENTHS) == ()
    for distance in (8.0, 3.0):
        points.watch(replace(REST, axial_m=distance))
    assert points.next is None
    assert points.go(REST, TWO_TENTHS) == ("there is no hold point left",)
    points.begin(25.0)
    assert len([p for p in points.points if p.decision == "open"]) == 3


def test_a_point_that_was_not_flown_past_is_behind():
    points = HoldPoints(25.0)
    # from the side into the corridor, within the first point
    points.watch(replace(REST, axial_m=21.0, right_m=40.0))
    points.watch(replace(REST, axial_m=12.0))
    points.watch(replace(REST, axial_m=8.0))
    assert [p.decision for p in points.points] == ["behind", "passed", "open"]


def test_a_point_is_passed_on_the_axis_alone():
    points = HoldPoints(60.0)
    off_axis = replace(REST, axial_m=1.7, right_m=17.0)
    assert points.watch(off_axis) is None
    assert [p.decision for p in points.points] == ["open"] * 4
    # the autopilot goes round to the axis, and holds at what lies ahead of its distance
    points.rearm(off_axis)
    assert [p.axial_m for p in points.points] == [10.0, 5.0]
    on_axis = replace(REST, axial_m=8.0)
    points.rearm(on_axis)
    assert [p.axial_m for p in points.points] == [10.0, 5.0]
    assert points.watch(on_axis) is not None
    points.rearm(replace(REST, axial_m=0.1, down_m=-3.0))
    assert [p.axial_m for p in points.points] == [5.0]


def test_the_display_draws_the_port_where_the_camera_sees_it():
    plan = plan_of("iss-orbit-limb")
    flight, port = plan.flight, docking_port(plan.target, plan.flight)
    f = docking_figures(flight.chaser(30.0), flight.attitude(30.0), port)
    scene = plan.scene_of(flight.state(30.0), 0)
    rim = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, -0.5, -20.0]])
    in_target = (
        rim @ matrix_from_quat(port.q_target_from_port_wxyz).T + port.origin_m + plan.target.mass.com_m
    )
    np.testing.assert_allclose(f.in_camera_m(rim), scene.camera_from_target.apply(in_target), atol=1e-6)


def test_where_the_docking_point_is_aimed_at():
    assert replace(REST, closing_m_s=-0.1).aimed_at_m is None
    moving = replace(REST, closing_m_s=0.5, right_m=0.3, right_m_s=-0.01, down_m_s=0.02)
    assert moving.aimed_at_m == pytest.approx((0.1, 0.4))


@pytest.mark.parametrize(("closing_m_s", "away_m_s"), [(0.5, 0.15), (1.2, 0.36), (0.02, 0.01)])
def test_a_touch_that_is_no_docking_sends_a_share_of_the_closing_speed_back(closing_m_s, away_m_s):
    """Three tenths of it, and a centimetre a second at least; what goes along the surface goes on."""
    plan = plan_of("tango-flyaround")
    watch = Docking(plan.target, plan.flight, None)
    watch.limits = replace(TWO_TENTHS)
    attitude = plan.flight.attitude(0.0)
    still = chaser_before(plan, (0.0, 0.0, -0.001), (12.0, 0.0, 0.0))
    p = np.array(still.position_eci_m)
    out = p / np.linalg.norm(p)
    aside = np.cross(out, [0.0, 0.0, 1.0])
    at_rest = np.array(still.velocity_eci_m_s)
    coming = at_rest - closing_m_s * out + 0.04 * aside
    before = replace(still, velocity_eci_m_s=vec3(coming))
    after = replace(before, t_s=0.1, position_eci_m=vec3(p + 0.1 * coming))
    state, news = watch.after_step(before, after, plan.flight)
    assert [kind for kind, _ in news] == ["warning"]
    assert not watch.docked
    left = np.array(state.velocity_eci_m_s) - at_rest
    assert attitude[1] is not None
    assert left @ out == pytest.approx(away_m_s, abs=1e-9)
    assert left @ aside == pytest.approx(0.04 * (aside @ aside), abs=1e-9)
    assert state.position_eci_m == before.position_eci_m
