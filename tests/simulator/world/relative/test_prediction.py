"""Predicted drift against the propagation, on circular and elliptic orbits."""

import numpy as np
import pytest

from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.guidance.manual_control import ChaserState, predicted_drift_lvlh_m
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements


@pytest.mark.parametrize("eccentricity", [0.0, 0.3])
def test_predicted_drift_is_where_the_chaser_drifts(eccentricity):
    r, v = state_from_elements(
        Elements(semi_major_axis_m=1e7, eccentricity=eccentricity, inclination_rad=1.0, true_anomaly_rad=0.8)
    )
    p, w = np.array([4.0, -15.0, 6.0]), np.array([0.01, 0.02, -0.01])
    track = propagate(r, v, 1500.0, Gravity(j2=0.0), (p, w))
    later, moving = track.relative(300.0)
    chaser = ChaserState(
        t_s=300.0,
        position_eci_m=vec3(later),
        velocity_eci_m_s=vec3(moving),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
    )
    path = predicted_drift_lvlh_m(track, chaser, 1200.0, 5)
    for k, t in enumerate(np.linspace(300.0, 1500.0, 5)):
        there, _ = track.frame(float(t)).from_eci(*track.relative(float(t)))
        # second order: (30 m)^2 over 10,000 km
        assert np.allclose(path[k], there, atol=1e-3)
