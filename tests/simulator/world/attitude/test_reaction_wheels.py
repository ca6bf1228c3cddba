"""Reaction wheels: tracking, conservation of angular momentum, limits of torque and momentum."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.attitude.reaction_wheels import Wheels, fly_wheels
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    rotation_angle_rad,
)

J = (12.0, 18.0, 25.0)


def resting(_t):
    return np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)


def total_momentum(track, k):
    body = np.array(J) * track.omega_rad_s[k] + track.momentum_nms[k]
    return matrix_from_quat(track.q_eci_from_camera_wxyz[k]) @ body


def test_small_error_dies_as_the_second_order_system_it_is():
    wheels = Wheels(
        inertia_kg_m2=J,
        torque_nm=10.0,
        momentum_nms=100.0,
        period_s=0.02,
        start_error_deg=np.degrees((0.0, 0.0, 1e-3)),
    )
    track = fly_wheels(resting, 30.0, wheels)
    w, z = wheels.bandwidth_rad_s, wheels.damping
    d = w * np.sqrt(1 - z * z)
    t = np.arange(len(track.error_rad)) * wheels.period_s
    exact = 1e-3 * np.exp(-z * w * t) * (np.cos(d * t) + z * w / d * np.sin(d * t))
    # the torque is held over each period, which lags by half of one
    assert np.max(np.abs(track.error_rad - np.abs(exact))) < 5e-6


def test_wheels_and_body_keep_their_momentum():
    wheels = Wheels(
        inertia_kg_m2=J, torque_nm=0.5, momentum_nms=20.0, start_error_deg=np.degrees((0.4, -0.8, 0.6))
    )
    track = fly_wheels(resting, 60.0, wheels)
    momenta = np.array([total_momentum(track, k) for k in range(len(track.error_rad))])
    assert np.max(np.abs(momenta - momenta[0])) < 1e-6
    assert track.error_rad[-1] < 1e-3


def test_a_slew_takes_the_time_its_torque_needs():
    """Rest to rest over an angle takes at least two root (angle J / torque)."""
    angle, torque = 1.0, 0.05
    wheels = Wheels(
        inertia_kg_m2=J, torque_nm=torque, momentum_nms=50.0, start_error_deg=np.degrees((0.0, 0.0, angle))
    )
    track = fly_wheels(resting, 200.0, wheels)
    fastest = 2 * np.sqrt(angle * J[2] / torque)
    halfway = fastest / 2
    settled = np.flatnonzero(track.error_rad > 0.01)[-1] * wheels.period_s
    assert np.max(np.abs(track.torque_nm)) == pytest.approx(torque)
    assert settled > fastest
    early = int(0.3 * halfway / wheels.period_s)
    # full torque from the start: half a t squared
    moved = 0.5 * torque / J[2] * (early * wheels.period_s) ** 2
    assert track.error_rad[early] == pytest.approx(angle - moved, abs=1e-6)


def test_rate_is_the_derivative_between_the_periods():
    wheels = Wheels(
        inertia_kg_m2=J, torque_nm=0.5, momentum_nms=20.0, start_error_deg=np.degrees((0.4, -0.8, 0.6))
    )
    track, h = fly_wheels(resting, 20.0, wheels), 1e-3
    for t in (3.1, 9.87):
        (a, _), (now, omega), (b, _) = track(t - h), track(t), track(t + h)
        spin = matrix_from_quat(now) @ (matrix_from_quat(b).T - matrix_from_quat(a).T) / (2 * h)
        assert np.allclose(omega, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6)
    assert rotation_angle_rad(quat_conjugate(quat_from_rotvec([0.4, -0.8, 0.6])), track(0.0)[0]) < 1e-12


def test_camera_on_wheels_keeps_the_target_in_view():
    scenario = load_scenario("tango-flyaround")
    chaser = msgspec.structs.replace(scenario.chaser, wheels=Wheels(start_error_deg=(3.0, 0.0, 0.0)))
    plan = plan_flight(msgspec.structs.replace(scenario, chaser=chaser), n=2)
    los = []
    for t in (0.0, 50.0):
        s = plan.flight.state(t)
        seen = -matrix_from_quat(s.q_camera_from_eci_wxyz) @ np.array(s.relative_eci_m)
        los.append(np.degrees(np.arctan2(np.hypot(seen[0], seen[1]), seen[2])))
    # the scenario itself looks a little aside
    planned = plan_flight(scenario, n=2).flight.state(50.0)
    aside = -matrix_from_quat(planned.q_camera_from_eci_wxyz) @ np.array(planned.relative_eci_m)
    assert los[1] == pytest.approx(np.degrees(np.arctan2(np.hypot(*aside[:2]), aside[2])), abs=0.05)
    assert abs(los[0] - los[1]) > 0.5


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_is_as_full_one_way_as_the_other(axis, sign):
    """A half turn to the right and one to the left: the wheel stops at its momentum, and the body at J^-1 of it."""
    error = np.zeros(3)
    error[axis] = sign * 1.5
    wheels = Wheels(
        inertia_kg_m2=J, torque_nm=1.0, momentum_nms=0.5, start_error_deg=tuple(np.degrees(error))
    )
    track = fly_wheels(resting, 20.0, wheels)
    held = track.momentum_nms[:, axis] * sign
    assert held.max() == pytest.approx(0.5, abs=1e-9)
    assert held.min() > -1e-3
    # what the wheel took, the body turns with, the error's way back
    assert (-sign * track.omega_rad_s[:, axis]).max() == pytest.approx(0.5 / J[axis], rel=1e-3)
