"""Bounded relative motion about a target on an eccentric orbit closes after a revolution."""

import numpy as np
import pytest

from flyaround.simulator.world.constants import MU_EARTH_M3_S2
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.guidance.free_flight import NaturalCircumnavigation, SafeEllipse
from flyaround.simulator.world.orbit.forces import EarthForces
from flyaround.simulator.world.orbit.propagation import (
    Elements,
    elements_from_state,
    propagate,
    state_from_elements,
)
from flyaround.simulator.world.relative.yamanaka_ankersen import elliptic_transition_matrix
from flyaround.simulator.world.time.instant import Instant

ROUND = EarthForces(sky=EphemerisTable.build(Instant.from_utc("2026-03-20T12:00:00Z"), 3600.0))
MODES = [
    NaturalCircumnavigation(radial_m=50.0, phase_deg=30.0, cross_track_m=20.0, centre_along_track_m=30.0),
    NaturalCircumnavigation(radial_m=50.0),
    SafeEllipse(radial_m=40.0, cross_track_m=30.0, phase_deg=200.0),
]


@pytest.mark.parametrize("mode", MODES, ids=["offset", "plain", "safe"])
@pytest.mark.parametrize(
    ("e", "nu"), [(0.0, 1.0), (0.01, 0.5), (0.05, 0.0), (0.05, 2.5), (0.3, 4.0), (0.7, 1.0)]
)
def test_a_revolution_later_the_chaser_is_where_it_was(mode, e, nu):
    """To second order in the distance: centimetres of fifty metres, by the full equations of two bodies."""
    orbit = Elements(
        semi_major_axis_m=7.2e6 / (1 - e), eccentricity=e, inclination_rad=1.0, true_anomaly_rad=nu
    )
    r, v = state_from_elements(orbit)
    orbit = elements_from_state(r, v)
    period = 2 * np.pi * np.sqrt(orbit.semi_major_axis_m**3 / MU_EARTH_M3_S2)
    start = mode.start_lvlh(orbit, MU_EARTH_M3_S2)
    linear = elliptic_transition_matrix(orbit, period) @ np.concatenate(start)
    assert np.allclose(linear[:3], start[0], rtol=0, atol=1e-3)
    track = propagate(r, v, period, ROUND, lvlh_frame(r, v, ROUND.target(0.0, r, v)).to_eci(*start))
    path = np.array([track.frame(t).from_eci(*track.relative(t))[0] for t in np.linspace(0.0, period, 200)])
    assert np.linalg.norm(path[-1] - path[0]) < 0.1
    # the radial swing is the one asked for
    assert np.abs(path[:, 0]).max() == pytest.approx(mode.radial_m, rel=1e-2)
    if isinstance(mode, SafeEllipse):
        assert np.hypot(path[:, 0], path[:, 2]).min() > mode.min_distance_m - 0.05


def test_on_a_circle_it_is_the_ellipse_of_two_to_one():
    orbit = Elements(semi_major_axis_m=7.2e6)
    n = np.sqrt(MU_EARTH_M3_S2 / 7.2e6**3)
    for mode in MODES:
        assert np.allclose(mode.start_lvlh(orbit, MU_EARTH_M3_S2), mode.state_lvlh(0.0, n), rtol=1e-12)
