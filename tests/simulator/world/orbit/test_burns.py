"""Burns of both spacecraft: vis-viva energy, impulsive and finite burns, relative motion."""

import numpy as np
import pytest

from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.guidance.manual_control import ChaserState, SteeringCommand, step
from flyaround.simulator.world.guidance.paths import Hold
from flyaround.simulator.world.guidance.thruster_control import fly_controlled
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.orbit.burns import Burn
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements

ROUND = Gravity(j2=0.0)
R0, V0 = state_from_elements(Elements(semi_major_axis_m=7e6, inclination_rad=1.0, raan_rad=0.3))
N = np.sqrt(MU_EARTH_M3_S2 / 7e6**3)
APART = np.array([3.0, -9.0, 2.0]), np.array([0.01, -0.005, 0.002])


def semi_major_axis(r, v):
    return float(1 / (2 / np.linalg.norm(r) - v @ v / MU_EARTH_M3_S2))


def test_along_track_impulse_raises_the_orbit_by_vis_viva():
    track = propagate(
        R0, V0, 200.0, ROUND, burns=(Burn(craft="target", start_s=100.0, delta_v_lvlh_m_s=(0.0, 5.0, 0.0)),)
    )
    before, after = track(100.0 - 1e-9)[1], track(100.0)[1]
    speed = np.linalg.norm(before)
    assert np.linalg.norm(after) == pytest.approx(speed + 5.0, abs=1e-6)
    expected = 1 / (2 / 7e6 - (speed + 5.0) ** 2 / MU_EARTH_M3_S2)
    assert semi_major_axis(*track(200.0)) == pytest.approx(expected, abs=0.01)


def test_impulse_of_the_chaser_is_a_start_in_the_new_state():
    burn = Burn(craft="chaser", start_s=300.0, delta_v_lvlh_m_s=(0.02, 0.03, -0.01))
    whole = propagate(R0, V0, 900.0, ROUND, APART, (burn,))
    p, w = propagate(R0, V0, 300.0, ROUND, APART).relative(300.0)
    r, v = whole(300.0)
    kick = lvlh_frame(r, v, ROUND.acceleration(r)).R_eci_from_lvlh @ np.array(burn.delta_v_lvlh_m_s)
    again = propagate(r, v, 600.0, ROUND, (p, w + kick))
    assert np.allclose(whole.relative(900.0)[0], again.relative(600.0)[0], atol=1e-8, rtol=0)


def test_a_short_strong_burn_nears_the_impulse_and_a_long_one_has_its_acceleration():
    def end(duration):
        start = 500.0 - duration / 2
        burn = Burn(craft="chaser", start_s=start, delta_v_lvlh_m_s=(0.0, 0.1, 0.0), duration_s=duration)
        return propagate(R0, V0, 1500.0, ROUND, APART, (burn,)).relative(1500.0)[0]

    impulse = end(0.0)
    errors = [np.linalg.norm(end(d) - impulse) for d in (40.0, 80.0)]
    # centred on the impulse, what is left grows with the square of the duration
    assert errors[1] / errors[0] == pytest.approx(4.0, rel=0.1)
    push = Burn(craft="target", start_s=10.0, delta_v_lvlh_m_s=(0.0, 1.0, 0.0), duration_s=50.0)
    track = propagate(R0, V0, 100.0, ROUND, burns=(push,))
    extra = track.acceleration(30.0) - ROUND.acceleration(track(30.0)[0])
    assert np.linalg.norm(extra) == pytest.approx(0.02, rel=1e-6)
    # the slope of the track knows of it too: the frame of a burning target is the exact one
    assert np.allclose(track.solution.rate(30.0)[3:], track.acceleration(30.0), atol=1e-8)


def test_a_chaser_under_control_and_one_by_hand_see_the_target_kick():
    kick = Burn(craft="target", start_s=20.5, delta_v_lvlh_m_s=(0.0, 0.05, 0.0))
    free = propagate(R0, V0, 60.0, ROUND, APART, (kick,))
    alone = propagate(R0, V0, 60.0, ROUND, burns=(kick,))
    state = ChaserState(
        t_s=0.0,
        position_eci_m=tuple(APART[0]),
        velocity_eci_m_s=tuple(APART[1]),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
    )
    for _ in range(60):
        state = step(state, SteeringCommand(), 1.0, alone)
    assert np.allclose(state.position_eci_m, free.relative(60.0)[0], atol=1e-7, rtol=0)
    hold = Hold(position_lvlh_m=(0.0, -10.0, 0.0))
    held = fly_controlled(alone, hold, N, Thrusters(mass_kg=50.0, force_n=2.0))
    quiet = fly_controlled(propagate(R0, V0, 60.0, ROUND), hold, N, Thrusters(mass_kg=50.0, force_n=2.0))
    # 50 mm/s away is met by as much thrust
    assert held.delta_v_m_s - quiet.delta_v_m_s == pytest.approx(0.05, abs=0.02)
    gap = held(20.5 + 1e-6)[1] - held(20.5 - 1e-6)[1]
    assert np.linalg.norm(gap) == pytest.approx(0.05, abs=1e-4)
