"""Yamanaka-Ankersen against Clohessy-Wiltshire and against differences of full propagations."""

import numpy as np
import pytest

from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import (
    Elements,
    elements_from_state,
    propagate,
    state_from_elements,
)
from flyaround.simulator.world.relative.clohessy_wiltshire import transition_matrix
from flyaround.simulator.world.relative.yamanaka_ankersen import (
    elliptic_transition_matrix,
    true_anomaly_after,
)

ROUND = Gravity(j2=0.0)


def test_on_a_circle_it_is_clohessy_wiltshire():
    a = 7078e3
    n = np.sqrt(MU_EARTH_M3_S2 / a**3)
    for t in (100.0, 3000.0, 20000.0):
        ours = elliptic_transition_matrix(Elements(semi_major_axis_m=a, true_anomaly_rad=1.0), t)
        assert np.allclose(ours, transition_matrix(n, t), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("e", [0.05, 0.4, 0.7])
def test_error_falls_with_the_square_of_the_distance(e):
    orbit = Elements(
        semi_major_axis_m=7000e3 / (1 - e), eccentricity=e, inclination_rad=1.1, true_anomaly_rad=0.7
    )
    r, v = state_from_elements(orbit)
    base = np.array([60.0, -80.0, 40.0, 0.01, -0.05, 0.02])
    span = 4000.0
    errors = []
    for scale in (1.0, 2.0, 4.0):
        frame = lvlh_frame(r, v, ROUND.acceleration(r))
        track = propagate(r, v, span, ROUND, frame.to_eci(scale * base[:3], scale * base[3:]))
        then = lvlh_frame(*track(span), track.acceleration(span))
        truth = np.concatenate(then.from_eci(*track.relative(span)))
        off = elliptic_transition_matrix(orbit, span) @ (scale * base) - truth
        errors.append((np.linalg.norm(off[:3]), np.linalg.norm(off[3:])))
    slopes = np.log2(np.array(errors[1:]) / errors[:-1])
    assert np.allclose(slopes, 2.0, atol=0.05)  # of the position and of the velocity


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7])
def test_velocity_is_how_fast_the_position_changes(e):
    """Rows 4 to 6 are the time derivative of rows 1 to 3, by central differences: 1e-6 of the largest."""
    orbit = Elements(semi_major_axis_m=7000e3 / (1 - e), eccentricity=e, true_anomaly_rad=-0.4)
    h = 0.05
    for t in (10.0, 1700.0, 9000.0):
        before, now, after = (elliptic_transition_matrix(orbit, t + dt) for dt in (-h, 0.0, h))
        slope = (after - before)[:3] / (2 * h)
        assert np.allclose(now[3:], slope, rtol=0, atol=1e-6 * np.abs(slope).max(axis=0))
    assert np.allclose(elliptic_transition_matrix(orbit, 0.0), np.eye(6), atol=1e-9)


def test_kepler_counts_turns():
    orbit = Elements(semi_major_axis_m=9000e3, eccentricity=0.3, true_anomaly_rad=0.4)
    period = 2 * np.pi * np.sqrt(9000e3**3 / MU_EARTH_M3_S2)
    assert true_anomaly_after(orbit, 3 * period) == pytest.approx(0.4 + 6 * np.pi)
    r, v = state_from_elements(orbit)
    there = elements_from_state(*propagate(r, v, 2000.0, ROUND)(2000.0))
    assert true_anomaly_after(orbit, 2000.0) == pytest.approx(there.true_anomaly_rad, abs=1e-8)
