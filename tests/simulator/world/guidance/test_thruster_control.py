"""Flights by thrusters: tracking, limits, fuel, bounds of range, keep-out and abort."""

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.guidance.free_flight import RangeKeeping
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.paths import Glideslope, Hold, VbarApproach, Waypoints
from flyaround.simulator.world.guidance.thruster_control import fly_controlled
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements

R0, V0 = state_from_elements(Elements(semi_major_axis_m=7078e3, inclination_rad=1.7, eccentricity=0.001))
N = np.sqrt(3.986004418e14 / 7078e3**3)
ORBIT_S = 2 * np.pi / N


def fly(mode, span, thrusters=None, keep_out=None):
    return fly_controlled(propagate(R0, V0, span, Gravity()), mode, N, thrusters or Thrusters(), keep_out)


def lvlh(track, t):
    frame = lvlh_frame(*track.orbit(t), track.orbit.acceleration(t))
    return np.concatenate(frame.from_eci(*track(t)))


@pytest.mark.parametrize(
    "mode",
    [
        Hold(position_lvlh_m=(8.0, 3.0, 2.0)),
        VbarApproach(start_m=-30, hold_m=-10, speed_m_s=0.05),
        Waypoints(points_lvlh_m=((0, -20, 0), (10, -10, 0), (10, 0, 5)), speed_m_s=0.06, rest_s=30.0),
        Glideslope(start_lvlh_m=(0, -30, 0), end_lvlh_m=(0, -3, 0), start_m_s=0.1, end_m_s=0.01),
    ],
    ids=lambda m: type(m).__name__,
)
def test_thrusters_follow_the_path(mode):
    track = fly(mode, 600.0)
    for t in np.linspace(0.0, 600.0, 13):
        p, _ = mode.state_lvlh(float(t), N)
        # a pulse of 0.01 N s on 100 kg: 0.1 mm/s is let pass, for some tens of seconds
        assert np.linalg.norm(lvlh(track, float(t))[:3] - p) < 0.03
    assert track.mass_kg[-1] < track.mass_kg[0]


def test_reference_velocity_is_the_derivative_of_the_path():
    for mode in (
        Waypoints(points_lvlh_m=((0, -20, 0), (10, -10, 0), (10, 0, 5)), speed_m_s=0.06, rest_s=30.0),
        Glideslope(start_lvlh_m=(0, -30, 0), end_lvlh_m=(0, -3, 0), start_m_s=0.1, end_m_s=0.01),
    ):
        for t in (10.0, 100.0, 333.0, 500.0):
            (p1, _), (p0, _) = mode.state_lvlh(t + 1e-3, N), mode.state_lvlh(t - 1e-3, N)
            assert np.allclose((p1 - p0) / 2e-3, mode.state_lvlh(t, N)[1], atol=1e-6)


def test_waypoints_are_reached_in_turn_and_rested_at():
    """Legs of 12 m and 5 m at 0.1 m/s, ten seconds at each point: half a leg after half its time."""
    path = Waypoints(points_lvlh_m=((0, 0, 0), (0, 12, 0), (3, 12, 4)), speed_m_s=0.1, rest_s=10.0)
    for t, p in (
        (0.0, (0, 0, 0)),
        (10.0, (0, 0, 0)),
        (70.0, (0, 6, 0)),
        (130.0, (0, 12, 0)),
        (140.0, (0, 12, 0)),
        (165.0, (1.5, 12, 2)),
        (190.0, (3, 12, 4)),
        (999.0, (3, 12, 4)),
    ):
        assert path.state_lvlh(t, N)[0] == pytest.approx(p, abs=1e-12)
    # between rests half as fast again as on average, along the leg
    assert path.state_lvlh(70.0, N)[1] == pytest.approx((0, 0.15, 0))
    assert path.state_lvlh(135.0, N)[1] == pytest.approx((0, 0, 0))
    # a quarter of the time is 5/32 of the way
    assert path.state_lvlh(40.0, N)[0] == pytest.approx((0, 12 * 5 / 32, 0))


def test_glideslope_arrives_at_its_final_speed():
    mode = Glideslope(start_lvlh_m=(0, -30, 0), end_lvlh_m=(0, -3, 0), start_m_s=0.1, end_m_s=0.01)
    arrival = 27.0 / 0.09 * np.log(10)
    assert np.linalg.norm(mode.state_lvlh(0.0, N)[1]) == pytest.approx(0.1)
    assert np.linalg.norm(mode.state_lvlh(arrival - 1e-3, N)[1]) == pytest.approx(0.01, rel=1e-3)
    assert mode.state_lvlh(arrival + 1.0, N)[0].tolist() == [0, -3, 0]


def test_thrust_and_impulse_are_limited():
    thrusters = Thrusters(
        mass_kg=100.0, force_n=0.5, minimum_impulse_ns=0.02, period_s=2.0, specific_impulse_s=200.0
    )
    given, mass = thrusters.fire(np.array([1.0, -1e-4, 5e-3]), 100.0)
    assert np.allclose(given, [0.01, 0.0, 5e-3])
    assert 100.0 - mass == pytest.approx((1.0 + 0.5) / (200 * 9.80665))


def test_range_stays_within_3_and_18_m_for_two_orbits():
    mode = RangeKeeping(position_lvlh_m=(6.0, 8.0, 3.0), near_m=3.0, far_m=18.0)
    track = fly(mode, 2 * ORBIT_S, Thrusters(period_s=5.0))
    ranges = np.array([np.linalg.norm(track(t)[0]) for t in np.linspace(0, 2 * ORBIT_S, 1500)])
    assert ranges.min() >= 3.0
    assert ranges.max() <= 18.0
    assert track.delta_v_m_s < 1.0
    assert np.count_nonzero(np.linalg.norm(track.thrust_eci_m_s2, axis=1)) < 0.2 * len(track.mass_kg)


def test_leaving_the_corridor_aborts_and_retreats():
    corridor = KeepOut(radius_m=10.0, corridor_axis_lvlh=(0, -1, 0), corridor_half_angle_deg=np.degrees(0.2))
    inside = VbarApproach(start_m=-20, hold_m=-4, speed_m_s=0.1)
    aside = Glideslope(start_lvlh_m=(4, -20, 0), end_lvlh_m=(4, -4, 0), start_m_s=0.1, end_m_s=0.1)
    good, bad = fly(inside, 400.0, None, corridor), fly(aside, 400.0, None, corridor)
    assert good.abort_s is None
    assert bad.abort_s is not None
    assert np.linalg.norm(good(400.0)[0]) == pytest.approx(4.0, abs=0.05)
    assert min(np.linalg.norm(bad(float(t))[0]) for t in range(400)) > 9.0
    assert np.linalg.norm(bad(400.0)[0]) > 15.0
    assert not corridor.violated(np.array([0, -5.0, 0.1]))
    assert corridor.violated(np.array([0, 5.0, 0.0]))


def test_delta_v_is_that_of_the_mass_that_was_spent():
    """Tsiolkovsky; each axis has its own thruster, and what they give is added as a vector: along one axis here."""
    spent = Thrusters(period_s=4.0, mass_kg=50.0, specific_impulse_s=180.0)
    track = fly(VbarApproach(start_m=-30, hold_m=-10, speed_m_s=0.05), 300.0, spent)
    mass = track.mass_kg[-2] if np.any(track.thrust_eci_m_s2[-1]) else track.mass_kg[-1]
    wanted = 180.0 * 9.80665 * np.log(50.0 / mass)
    # of a vector less is needed than of its parts one by one
    assert wanted / np.sqrt(3) <= track.delta_v_m_s <= 1.05 * wanted
    assert track.delta_v_m_s > 0.02  # to stop, and to hold there


def test_retreat_ends_at_twice_the_radius():
    corridor = KeepOut(radius_m=10.0, corridor_axis_lvlh=(0, -1, 0), corridor_half_angle_deg=np.degrees(0.2))
    aside = Glideslope(start_lvlh_m=(4, -20, 0), end_lvlh_m=(4, -4, 0), start_m_s=0.1, end_m_s=0.1)
    track = fly(aside, 1200.0, Thrusters(period_s=2.0), corridor)
    ranges = np.linalg.norm(track.position_eci_m, axis=1)
    beyond = (ranges > 20.0) & (np.arange(len(ranges)) * track.period_s > track.abort_s)
    assert np.count_nonzero(beyond) > 10
    assert not track.thrust_eci_m_s2[beyond].any()
    within = (ranges < 20.0) & (np.arange(len(ranges)) * track.period_s > track.abort_s)
    assert track.thrust_eci_m_s2[within].any()


def test_state_between_the_periods_is_continuous():
    track = fly(Hold(position_lvlh_m=(8.0, 3.0, 2.0)), 30.0)
    for k in range(1, 30):
        assert np.allclose(track(k - 1e-9)[0], track(float(k))[0], atol=1e-8, rtol=0)


def test_thrusters_do_not_burn_more_than_the_chaser():
    thrusters = Thrusters(force_n=1e5, specific_impulse_s=0.1, period_s=10.0)
    with pytest.raises(UserError, match="specific_impulse_s"):
        thrusters.fire(np.array([1e3, 0.0, 0.0]), 100.0)


def test_no_period_beyond_the_end_burns_fuel():
    """The quotient of 1.05 s and 0.15 s is above 7."""
    thrusters = Thrusters(period_s=0.15)
    tracks = [
        fly(Waypoints(points_lvlh_m=((0, -20, 0), (0, -10, 0)), speed_m_s=0.06), span, thrusters)
        for span in (1.04, 1.05)
    ]
    assert [len(track.mass_kg) for track in tracks] == [7, 7]
    assert tracks[0].end_mass_kg == pytest.approx(tracks[1].end_mass_kg, rel=1e-12)
