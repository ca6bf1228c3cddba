"""Relative motion: LVLH, Clohessy-Wiltshire, guidance modes, steering by hand."""

import numpy as np
import pytest

from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_rotvec,
)
from flyaround.simulator.world.guidance.manual_control import ChaserState, SteeringCommand, step
from flyaround.simulator.world.guidance.paths import ForcedFlyaround, VbarApproach
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.relative.clohessy_wiltshire import (
    bounded_ellipse,
    mean_motion_rad_s,
    transition_matrix,
)

A_M = 7078e3
N = mean_motion_rad_s(A_M, Gravity().mu_m3_s2)
R0, V0 = state_from_elements(
    Elements(semi_major_axis_m=A_M, inclination_rad=1.7, raan_rad=0.4, true_anomaly_rad=2.0)
)
ROUND = Gravity(j2=0.0)


def in_lvlh(track, t):
    frame = lvlh_frame(*track(t), track.acceleration(t))
    return np.concatenate(frame.from_eci(*track.relative(t)))


def drift(state_lvlh, duration_s):
    start = lvlh_frame(R0, V0, ROUND.acceleration(R0)).to_eci(state_lvlh[:3], state_lvlh[3:])
    return propagate(R0, V0, duration_s, ROUND, start)


def test_lvlh_axes_and_rates():
    gravity = Gravity()
    track = propagate(R0, V0, 100.0, gravity)
    r, v = track(50.0)
    frame = lvlh_frame(r, v, gravity.acceleration(r))
    x, y, z = frame.R_eci_from_lvlh.T
    assert np.allclose(x, r / np.linalg.norm(r))
    assert y @ v > 0
    assert np.allclose(z, np.cross(x, y))
    h = 0.5
    after, before = (lvlh_frame(*track(50 + s), track.acceleration(50 + s)).R_eci_from_lvlh for s in (h, -h))
    turning = (after - before) / (2 * h) @ frame.R_eci_from_lvlh.T
    measured = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    assert np.allclose(frame.omega_eci_rad_s, measured, atol=1e-9, rtol=0)
    p, w = np.array([3.0, -4.0, 5.0]), np.array([0.1, 0.2, -0.3])
    assert np.allclose(np.concatenate(frame.from_eci(*frame.to_eci(p, w))), np.concatenate([p, w]))


def test_clohessy_wiltshire_errs_by_the_square_of_the_distance():
    base = np.array([60.0, -80.0, 40.0, 0.01, -0.05, 0.02])
    errors = []
    for scale in (1.0, 2.0, 4.0):
        predicted = transition_matrix(N, 2000.0) @ (scale * base)
        errors.append(np.linalg.norm(in_lvlh(drift(scale * base, 2000.0), 2000.0)[:3] - predicted[:3]))
    slopes = np.log2(np.array(errors[1:]) / errors[:-1])
    assert np.allclose(slopes, 2.0, atol=0.02)


def test_natural_circumnavigation_closes_and_stays_clear_of_the_along_track_axis():
    p, v = bounded_ellipse(N, 10.0, 0.3, cross_track_m=8.0, cross_phase_rad=np.pi / 2)
    period = 2 * np.pi / N
    track = drift(np.concatenate([p, v]), period)
    path = np.array([in_lvlh(track, float(t))[:3] for t in np.linspace(0, period, 200)])
    # 10 m on 7,078 km: the second-order drift is below a millimetre per orbit
    assert np.allclose(path[-1], path[0], atol=1e-3)
    assert np.ptp(path[:, 1]) == pytest.approx(2 * np.ptp(path[:, 0]), rel=1e-3)
    assert np.hypot(path[:, 0], path[:, 2]).min() > 7.9


def test_two_bodies_a_millimetre_apart_do_not_lose_digits():
    """A chaser one millimetre ahead on the same circle stays there to a tenth of a micrometre."""
    turn = 1e-3 / A_M
    frame = lvlh_frame(R0, V0, ROUND.acceleration(R0))
    z = frame.R_eci_from_lvlh[:, 2]
    start = (turn * np.cross(z, R0), turn * np.cross(z, V0))
    track = propagate(R0, V0, 3000.0, ROUND, start)
    assert in_lvlh(track, 3000.0)[1] == pytest.approx(1e-3, abs=1e-7)


def test_approach_cruises_brakes_and_holds():
    mode = VbarApproach(start_m=-30, hold_m=-10, speed_m_s=0.1, braking_m_s2=0.005)
    times = np.linspace(0, 260, 2601)
    states = [mode.state_lvlh(float(t), N) for t in times]
    y = np.array([p[1] for p, _ in states])
    speed = np.array([v[1] for _, v in states])
    assert y[0] == -30
    assert speed[0] == pytest.approx(0.1)
    assert y[-1] == -10
    assert speed[-1] == 0
    assert np.allclose(np.gradient(y, times)[1:-1], speed[1:-1], atol=6e-4)
    assert np.max(np.abs(np.diff(speed))) <= 0.005 * 0.1 + 1e-12


def test_flyaround_keeps_its_range_plane_and_period():
    mode = ForcedFlyaround(
        radius_m=9.0,
        period_s=240.0,
        inclination_deg=np.degrees(0.6),
        node_deg=np.degrees(0.4),
        phase_deg=12.0,
    )
    normal = np.array([np.sin(0.6) * np.sin(0.4), -np.sin(0.6) * np.cos(0.4), np.cos(0.6)])
    for t in np.linspace(0, 240, 13):
        p, v = mode.state_lvlh(float(t), N)
        assert np.linalg.norm(p) == pytest.approx(9.0)
        assert p @ normal == pytest.approx(0, abs=1e-12)
        assert np.allclose(np.cross(p, v), 81 * 2 * np.pi / 240 * normal)
    assert np.allclose(mode.state_lvlh(240.0, N)[0], mode.state_lvlh(0.0, N)[0])


def test_breathing_flyaround_swings_between_its_ranges():
    mode = ForcedFlyaround(radius_m=3.0, far_radius_m=18.0, range_period_s=100.0, period_s=400.0)
    ranges = [float(np.linalg.norm(mode.state_lvlh(float(t), N)[0])) for t in np.linspace(0, 100, 101)]
    assert ranges[0] == ranges[100] == pytest.approx(3.0)
    assert ranges[50] == pytest.approx(18.0)
    p1, p0 = (mode.state_lvlh(30 + s, N)[0] for s in (1e-4, -1e-4))
    assert np.allclose((p1 - p0) / 2e-4, mode.state_lvlh(30.0, N)[1], atol=1e-7)


START = ChaserState(
    t_s=0.0,
    position_eci_m=(8.0, -3.0, 5.0),
    velocity_eci_m_s=(0.01, 0.02, -0.01),
    q_camera_from_eci_wxyz=tuple(quat_from_rotvec([0.3, -0.5, 0.2])),
)


def test_thrust_turns_with_the_camera():
    """Half a turn under constant thrust gains the chord of the arc: 2/pi of the straight speed."""
    track = propagate(R0, V0, 10.0, Gravity())
    command = SteeringCommand(
        acceleration_camera_m_s2=(0.0, 0.0, 0.2), rate_camera_rad_s=(0.0, np.pi / 10, 0.0)
    )
    state, coast = START, START
    for _ in range(100):
        state, coast = step(state, command, 0.1, track), step(coast, SteeringCommand(), 0.1, track)
    gained = np.array(state.velocity_eci_m_s) - coast.velocity_eci_m_s
    right = matrix_from_quat(START.q_camera_from_eci_wxyz)[0]
    assert np.allclose(gained, 2 / np.pi * 0.2 * 10 * right, atol=1e-4)
