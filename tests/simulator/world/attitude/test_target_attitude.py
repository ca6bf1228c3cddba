"""Attitude of the target: pointing, spin, inertial rest, attitude files, magnetic torque."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.attitude.directions import PointingContext
from flyaround.simulator.world.attitude.target_attitude import Attitude, Point
from flyaround.simulator.world.attitude.torques import body_torque, magnetic_field_t
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_rotvec,
    quat_multiply,
    rotation_angle_rad,
)
from flyaround.simulator.world.messages.aem import read_aem_history, write_aem
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.time.instant import Instant

EPOCH = Instant.from_utc("2026-03-20T12:00:00Z")
SPAN = 3000.0
R0, V0 = state_from_elements(Elements(semi_major_axis_m=7e6, inclination_rad=1.7, eccentricity=0.01))
ORBIT = propagate(R0, V0, SPAN, Gravity(), (np.array([5.0, -8.0, 3.0]), np.array([0.01, 0.0, 0.02])))
AROUND = PointingContext(orbit=ORBIT, body=EARTH, epoch=EPOCH, duration_s=SPAN, relative=ORBIT.relative)
Q0 = quat_from_rotvec([0.4, -0.9, 0.2])
J = np.diag([2.5, 2.7, 3.9])


def pointed(axis, at, second_axis, second_at):
    point = Point(axis=axis, at=at, second_axis=second_axis, second_at=second_at)
    return Attitude(motion="point", point=point)


MOTIONS: dict[str, Attitude] = {
    "nadir": pointed((0, 0, 1), "nadir", (1, 0, 0), "along_track"),
    "sun": pointed((0, 0, 1), "sun", (1, 1, 0), "cross_track"),
    "chaser": pointed((1, 0, 0), "chaser", (0, 0, 1), "zenith"),
    "spin": Attitude(motion="spin", rate_deg_s=(1.2, 2.4, -1.2)),
    "lvlh": Attitude(motion="fixed", frame="lvlh"),
    "eci": Attitude(motion="fixed", frame="eci"),
    "tumble": Attitude(rate_deg_s=tuple(np.degrees((0.02, -0.03, 0.01)))),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_rate_is_the_derivative_of_the_attitude(name):
    track, h = MOTIONS[name].track(Q0, J, AROUND), 0.005
    for t in (10.0, 1234.5, 2900.0):
        (before, _), (now, omega), (after, _) = (track(t + s) for s in (-h, 0.0, h))
        R0_, R1_ = matrix_from_quat(before), matrix_from_quat(after)
        spin = matrix_from_quat(now).T @ (R1_ - R0_) / (2 * h)
        assert np.allclose(omega, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=2e-8, rtol=0)


def test_axes_point_where_they_are_told():
    t = 1700.0
    r, v = ORBIT(t)
    R = matrix_from_quat(MOTIONS["nadir"].track(Q0, J, AROUND)(t)[0])
    assert R[:, 2] @ r / np.linalg.norm(r) == pytest.approx(-1.0)
    assert R[:, 0] @ v / np.linalg.norm(v) == pytest.approx(1.0, abs=1e-4)
    now = EPOCH.plus(t)
    to_sun = sun_eci_m(now.tt1, now.tt2) - r
    R = matrix_from_quat(MOTIONS["sun"].track(Q0, J, AROUND)(t)[0])
    assert np.linalg.norm(R[:, 2] - to_sun / np.linalg.norm(to_sun)) < 1e-8
    p, _ = ORBIT.relative(t)
    R = matrix_from_quat(MOTIONS["chaser"].track(Q0, J, AROUND)(t)[0])
    assert np.allclose(R[:, 0], p / np.linalg.norm(p), atol=1e-12)


def test_at_rest_in_lvlh_and_among_the_stars():
    track = MOTIONS["lvlh"].track(Q0, J, AROUND)
    seen = [ORBIT.frame(t).R_eci_from_lvlh.T @ matrix_from_quat(track(t)[0]) for t in (0.0, 1500.0)]
    assert np.allclose(seen[0], seen[1], atol=1e-12)
    assert rotation_angle_rad(track(0.0)[0], Q0) < 1e-12
    assert np.array_equal(MOTIONS["eci"].track(Q0, J, AROUND)(2000.0)[0], Q0)


def test_directions_that_run_together_are_refused():
    # the along-track axis follows the velocity, nadir does not meet it; the zenith meets itself
    motion = pointed((0, 0, 1), "nadir", (1, 0, 0), "zenith")
    with pytest.raises(UserError, match="nadir and zenith run together 0 s after the start"):
        motion.track(Q0, J, AROUND)


def history_text(every_s):
    motion = MOTIONS["tumble"]
    track = motion.track(Q0, J, AROUND)
    times = np.arange(0.0, 601.0, every_s)
    text = write_aem(
        name="A",
        body_frame="SC_BODY_1",
        epochs_utc=[EPOCH.plus(float(t)).iso() for t in times],
        q_eci_from_body_wxyz=[track(float(t))[0] for t in times],
    )
    return text, motion


def test_history_of_a_file_is_followed_between_its_lines():
    track = MOTIONS["tumble"].track(Q0, J, AROUND)
    errors = []
    for every in (4.0, 8.0):
        text, _ = history_text(every)
        history = read_aem_history(text, "a.aem", EPOCH.plus(50.0), 400.0)
        worst = 0.0
        for t in np.linspace(0.0, 400.0, 41):
            (q, omega), (q0, omega0) = history(float(t)), track(float(t) + 50.0)
            worst = max(worst, rotation_angle_rad(q, q0))
            assert np.allclose(omega, omega0, atol=2e-4)
        errors.append(worst)
    assert errors[0] < 1e-5
    # a cubic: twice the spacing, sixteen times the error (the file's own rounding is 1e-12)
    assert errors[1] / errors[0] > 8


def test_history_that_does_not_cover_the_flight_or_has_a_gap_is_refused():
    text, _ = history_text(4.0)
    with pytest.raises(UserError, match=r"covers 2026-03-20T12:00:00.*to 2026-03-20T12:20"):
        read_aem_history(text, "a.aem", EPOCH, 1200.0)
    lines = text.splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line.startswith("2026-03-20T12:05"))
    with pytest.raises(UserError, match="s are missing before it"):
        read_aem_history("".join(lines[:first] + lines[first + 12 :]), "a.aem", EPOCH, 590.0)


def test_magnetic_field_points_north_and_doubles_at_the_pole():
    equator = magnetic_field_t(np.array([6371.2e3, 0, 0]), 2025.0)
    pole = magnetic_field_t(np.array([0, 0, 6371.2e3]), 2025.0)
    assert equator[2] == pytest.approx(29350e-9)
    assert pole[2] == pytest.approx(-2 * 29350e-9)
    # no sources outside the Earth's centre
    h, r = 1e3, np.array([5e6, 3e6, -4e6])
    field = [[magnetic_field_t(r + s * h * e, 2025.0) for s in (-1, 1)] for e in np.eye(3)]
    divergence = sum((b - a)[k] for k, (a, b) in enumerate(field)) / (2 * h)
    assert abs(divergence) < 1e-8 * np.linalg.norm(magnetic_field_t(r, 2025.0)) / 1.0


def test_residual_dipole_turns_like_a_compass_needle():
    torque = body_torque(ORBIT, J, EPOCH, residual_dipole_a_m2=(0.0, 0.0, 1.0))
    assert torque is not None
    R = matrix_from_quat(Q0)
    found = torque(100.0, R)
    # one ampere square metre in some 20 to 45 microtesla, normal to the moment
    assert found[2] == 0.0
    assert 1e-6 < np.linalg.norm(found) < 5e-5
    # a half turn about the moment leaves the needle and turns the torque with the body
    half = quat_multiply(Q0, quat_from_rotvec([0.0, 0.0, np.pi]))
    assert np.allclose(torque(100.0, matrix_from_quat(half)), -found)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_flight_goes_to_another_process(name):
    track = MOTIONS[name].track(Q0, J, AROUND)
    again = pickle.loads(pickle.dumps(track))  # noqa: S301 - our own bytes
    assert np.array_equal(np.concatenate(again(123.4)), np.concatenate(track(123.4)))


@pytest.mark.parametrize(
    ("year", "gauss_nt"),
    [(2015.0, (-1501.77, 4795.99, -29441.46)), (2020.0, (-1451.37, 4653.35, -29403.41))],
)
def test_dipole_drifts_as_it_was_observed_to(year, gauss_nt):
    """Definitive coefficients g11, h11, g10 of IGRF-14, of years that our field extrapolates to.

    The change of today is that of those years within 8 nT a year. Without any change h11 is off by 22 nT a year and
    more, with the other sign by twice that.
    """
    a = 6371.2e3
    # at the surface on each axis the radial field of a dipole is twice its moment
    found = [magnetic_field_t(a * axis, year)[k] / 2e-9 for k, axis in enumerate(np.eye(3))]
    assert np.allclose(found, gauss_nt, rtol=0, atol=8.0 * (2025.0 - year))


def test_torque_of_a_dipole_is_that_of_its_year():
    """The field turns with the Earth and drifts with the years: a flight's is that of its epoch, on its orbit."""
    for epoch in (EPOCH, Instant.from_utc("2044-03-20T12:00:00Z")):
        torque = body_torque(ORBIT, J, epoch, residual_dipole_a_m2=(3.0, -1.0, 2.0))
        assert torque is not None
        R, R_itrs = matrix_from_quat(Q0), R_itrs_from_eci(epoch.plus(700.0))
        year = 2000.0 + (epoch.tt1 + epoch.tt2 - 2451545.0) / 365.25
        field = R_itrs.T @ magnetic_field_t(R_itrs @ ORBIT(700.0)[0], year)
        # a thousandth of a year's change, 3e-10 of 3e-5 T
        assert np.allclose(torque(700.0, R), np.cross((3.0, -1.0, 2.0), R.T @ field), rtol=0, atol=1e-11)
