"""Conservation laws of the propagators, and round trips of Keplerian elements."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flyaround.simulator.world.attitude.rigid_body import check_inertia, propagate_attitude
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import (
    Elements,
    elements_from_state,
    propagate,
    state_from_elements,
)

angle = st.floats(0.05, 6.2)
orbits = st.builds(
    lambda h, e, i, o, w, n: Elements(
        semi_major_axis_m=(EARTH_RADIUS_M + h * 1e3) / (1 - e),
        eccentricity=e,
        inclination_rad=i,
        raan_rad=o,
        argument_of_perigee_rad=w,
        true_anomaly_rad=n,
    ),
    st.floats(300, 2000),
    st.floats(0.001, 0.7),
    st.floats(0.05, 3.0),
    angle,
    angle,
    angle,
)


@given(orbits)
def test_elements_survive_their_state(elements):
    back = elements_from_state(*state_from_elements(elements))
    r, v = state_from_elements(elements)
    r_back, v_back = state_from_elements(back)
    assert back.semi_major_axis_m == pytest.approx(elements.semi_major_axis_m, rel=1e-11)
    assert back.eccentricity == pytest.approx(elements.eccentricity, abs=1e-11)
    assert back.raan_rad == pytest.approx(elements.raan_rad, abs=1e-9)
    assert np.allclose(r_back, r, atol=1e-3, rtol=0)
    assert np.allclose(v_back, v, atol=1e-6, rtol=0)


def test_circular_equatorial_orbit_has_elements():
    elements = Elements(semi_major_axis_m=7e6, true_anomaly_rad=1.0)
    back = elements_from_state(*state_from_elements(elements))
    assert back.eccentricity == 0.0
    assert back.true_anomaly_rad == pytest.approx(1.0)


@settings(max_examples=15, deadline=None)
@given(orbits)
def test_energy_and_axial_momentum_are_kept(elements):
    gravity = Gravity()
    r, v = state_from_elements(elements)
    track = propagate(r, v, 6000.0, gravity)

    def energy(r, v):
        return float(v @ v) / 2 + gravity.potential(r)

    for t in np.linspace(0, 6000, 23):
        r_t, v_t = track(float(t))
        assert energy(r_t, v_t) == pytest.approx(energy(r, v), rel=1e-10)
        # J2 is symmetric about the pole: that component of the angular momentum stays
        h0 = float(np.linalg.norm(np.cross(r, v)))
        assert np.cross(r_t, v_t)[2] == pytest.approx(np.cross(r, v)[2], abs=1e-10 * h0)


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-1, 1)] * 3))
def test_acceleration_is_the_gradient_of_the_potential(direction, pole):
    up = np.array([0, 0, 1.5])
    d, p = np.array(direction) + up, np.array(pole) + up
    r = 7e6 * d / np.linalg.norm(d)
    px, py, pz = p / np.linalg.norm(p)
    gravity = Gravity(pole_eci=(px, py, pz))
    h = 50.0
    gradient = [(gravity.potential(r + h * e) - gravity.potential(r - h * e)) / (2 * h) for e in np.eye(3)]
    assert np.allclose(gravity.acceleration(r), -np.array(gradient), atol=1e-8, rtol=0)


@settings(max_examples=15, deadline=None)
@given(st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.tuples(st.floats(2, 3), st.floats(2, 3), st.floats(2, 3.9)))
def test_tumble_keeps_energy_and_momentum(omega, moments):
    J = np.diag(moments)
    J[0, 1] = J[1, 0] = 0.1
    w0 = np.array(omega)
    track = propagate_attitude([0.5, 0.5, 0.5, 0.5], w0, J, 300.0)
    L0 = matrix_from_quat([0.5, 0.5, 0.5, 0.5]) @ J @ w0
    for t in np.linspace(0, 300, 17):
        q, w = track(float(t))
        assert np.linalg.norm(q) == pytest.approx(1, abs=1e-15)
        assert w @ J @ w == pytest.approx(w0 @ J @ w0, abs=1e-12)
        assert np.allclose(matrix_from_quat(q) @ J @ w, L0, atol=1e-9, rtol=0)


@pytest.mark.parametrize(
    ("inertia", "sentence"),
    [
        (np.diag([1.0, 1.0, -1.0]), "positive definite"),
        (np.diag([1.0, 1.0, 3.0]), "no rigid body"),
        (np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1.0]]), "symmetric"),
    ],
)
def test_impossible_inertia_is_refused(inertia, sentence):
    with pytest.raises(ValueError, match=sentence):
        check_inertia(inertia)
