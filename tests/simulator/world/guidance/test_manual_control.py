"""Manual control: commands in LVLH and camera axes, the keep-out guard, the safe ellipse."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.frames.rotation import rotation_angle_rad
from flyaround.simulator.world.guidance.command_script import (
    CommandScript,
    ScriptedCommand,
    fly_script,
)
from flyaround.simulator.world.guidance.free_flight import SafeEllipse
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix

ROUND = Gravity(j2=0.0)
R0, V0 = state_from_elements(Elements(semi_major_axis_m=7e6, inclination_rad=1.0))
N = float(np.sqrt(MU_EARTH_M3_S2 / 7e6**3))


def fly(script, span, keep_out=None):
    guarded = msgspec.structs.replace(script, keep_out=keep_out)
    return fly_script(propagate(R0, V0, span, ROUND), guarded, N)


def lvlh(track, t):
    s = track(t)
    p, v = np.array(s.position_eci_m), np.array(s.velocity_eci_m_s)
    return np.concatenate(track.orbit.frame(t).from_eci(p, v))


def test_push_along_lvlh_follows_clohessy_wiltshire():
    a = np.array([0.001, -0.002, 0.0015])
    script = CommandScript(
        position_lvlh_m=(0.0, -20.0, 0.0),
        commands=(ScriptedCommand(start_s=50.0, duration_s=100.0, acceleration_m_s2=tuple(a)),),
    )
    state = transition_matrix(N, 50.0) @ np.array([0.0, -20.0, 0.0, 0.0, 0.0, 0.0])
    # small impulses at the middles of small spans
    for _ in range(400):
        state = transition_matrix(N, 0.125) @ state + np.concatenate([np.zeros(3), 0.25 * a])
        state = transition_matrix(N, 0.125) @ state
    state = transition_matrix(N, 150.0) @ state
    # the square of 20 m over 7000 km is what the linear equations leave out
    assert np.allclose(lvlh(fly(script, 300.0), 300.0)[:3], state[:3], atol=2e-3)


def test_push_along_the_camera_goes_to_the_target():
    script = CommandScript(
        position_lvlh_m=(0.0, -20.0, 0.0),
        commands=(
            ScriptedCommand(start_s=0.0, duration_s=10.0, acceleration_m_s2=(0.0, 0.0, 0.01), axes="camera"),
        ),
    )
    track = fly(script, 30.0)
    assert lvlh(track, 10.0)[4] == pytest.approx(0.1, abs=1e-3)
    # and between the steps the state is one
    for t in (3.0, 10.0, 20.5):
        assert np.allclose(lvlh(track, t - 1e-7), lvlh(track, t), atol=1e-6)


def test_untracked_camera_turns_at_the_commanded_rate():
    script = CommandScript(
        position_lvlh_m=(0.0, -20.0, 0.0),
        tracking=False,
        commands=(
            ScriptedCommand(start_s=2.0, duration_s=5.0, rate_camera_deg_s=(0.0, np.degrees(0.02), 0.0)),
        ),
    )
    track = fly(script, 10.0)
    q0, q1 = (track(t).q_camera_from_eci_wxyz for t in (1.0, 9.0))
    assert rotation_angle_rad(q0, q1) == pytest.approx(0.1, abs=1e-9)
    assert track(4.0).omega_camera_rad_s == pytest.approx((0.0, 0.02, 0.0))


@pytest.mark.parametrize("seed", range(6))
def test_no_command_gets_a_chaser_into_the_sphere(seed):
    rng = np.random.default_rng(seed)
    start = rng.normal(size=3)
    start = 25.0 * start / np.linalg.norm(start)
    sphere = KeepOut(radius_m=10.0)
    commands = [
        ScriptedCommand(
            start_s=20.0 * k, duration_s=20.0, acceleration_m_s2=tuple(rng.uniform(-0.02, 0.02, 3))
        )
        for k in range(10)
    ]
    # and all through it a push at the target
    commands.append(
        ScriptedCommand(start_s=0.0, duration_s=200.0, acceleration_m_s2=(0.0, 0.0, 0.03), axes="camera")
    )
    script = CommandScript(position_lvlh_m=tuple(start), commands=tuple(commands))
    track = fly(script, 200.0, sphere)
    nearest = min(np.linalg.norm(lvlh(track, t)[:3]) for t in np.arange(0.0, 200.0, 0.5))
    assert nearest > 9.9
    assert track.guarded_s is not None


def test_the_corridor_lets_in_and_keeps_from_leaving_sideways():
    corridor = KeepOut(radius_m=10.0, corridor_axis_lvlh=(0, -1, 0), corridor_half_angle_deg=np.degrees(0.25))
    forward = ScriptedCommand(start_s=0.0, duration_s=5.0, acceleration_m_s2=(0.0, 0.04, 0.0))
    entering = fly(CommandScript(position_lvlh_m=(0.0, -20.0, 0.0), commands=(forward,)), 70.0, corridor)
    assert entering.guarded_s is None
    assert np.linalg.norm(lvlh(entering, 70.0)[:3]) < 7.5
    sideways = ScriptedCommand(start_s=55.0, duration_s=20.0, acceleration_m_s2=(0.02, 0.0, 0.0))
    leaving = fly(
        CommandScript(position_lvlh_m=(0.0, -20.0, 0.0), commands=(forward, sideways)), 120.0, corridor
    )
    assert leaving.guarded_s is not None
    inside = [t for t in np.arange(0.0, 120.0, 0.5) if corridor.violated(lvlh(leaving, t)[:3])]
    # once overruled it is driven out, and is out again soon
    assert not corridor.violated(lvlh(leaving, 120.0)[:3])
    assert len(inside) < 80


def test_safe_ellipse_stays_clear_however_it_drifts():
    mode = SafeEllipse(radial_m=8.0, cross_track_m=6.0, phase_deg=40.0)
    p, v = mode.state_lvlh(0.0, N)
    # an error of along-track speed carries it past the target, within the ellipse's own hole
    v = v + np.array([0.0, 1e-4, 0.0])
    frame_start = propagate(R0, V0, 1.0, ROUND).frame(0.0)
    track = propagate(R0, V0, 12000.0, ROUND, frame_start.to_eci(p, v))
    across = []
    for t in np.linspace(0.0, 12000.0, 400):
        x, _, z = track.frame(float(t)).from_eci(*track.relative(float(t)))[0]
        across.append(np.hypot(x, z))
    assert min(across) > 0.9 * mode.min_distance_m
