"""The world against published values and analytic solutions, each with its source and tolerance."""

import erfa
import numpy as np
import pytest

from flyaround.simulator.world.attitude.rigid_body import propagate_attitude
from flyaround.simulator.world.constants import AU_M, EARTH_RADIUS_M, J2_EARTH, MU_EARTH_M3_S2
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import moon_eci_m, sun_eci_m
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply, rotation_angle_rad
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import (
    Elements,
    elements_from_state,
    propagate,
    state_from_elements,
)
from flyaround.simulator.world.time.instant import Instant


@pytest.mark.parametrize(
    "utc", ["1999-01-04T03:00:00Z", "2010-07-01T00:00:00Z", "2026-03-20T12:00:00Z", "2044-10-13T18:30:00Z"]
)
def test_sun_agrees_with_the_almanac(utc):
    """Astronomical Almanac, section C: low-precision formulas, 0.01 deg between 1950 and 2050."""
    t = Instant.from_utc(utc)
    n = t.tt1 - 2451545.0 + t.tt2
    L, g = 280.460 + 0.9856474 * n, np.radians(357.528 + 0.9856003 * n)
    longitude = np.radians(L + 1.915 * np.sin(g) + 0.020 * np.sin(2 * g))
    obliquity = np.radians(23.439 - 0.0000004 * n)
    almanac = np.array(
        [
            np.cos(longitude),
            np.cos(obliquity) * np.sin(longitude),
            np.sin(obliquity) * np.sin(longitude),
        ]
    )
    distance_au = 1.00014 - 0.01671 * np.cos(g) - 0.00014 * np.cos(2 * g)
    sun = sun_eci_m(t.tt1, t.tt2)
    of_date = erfa.pnm06a(t.tt1, t.tt2) @ sun
    separation = np.arctan2(np.linalg.norm(np.cross(of_date, almanac)), of_date @ almanac)
    assert np.degrees(separation) < 0.02
    assert np.linalg.norm(sun) / AU_M == pytest.approx(distance_au, abs=3e-4)


def test_sun_is_aberrated():
    """The apparent Sun trails the geometric one by 20.5 arcsec (constant of aberration, IAU 1976)."""
    tt1, tt2 = 2461120.0, 0.25
    heliocentric, _ = erfa.epv00(tt1, tt2)
    geometric, apparent = -heliocentric["p"], sun_eci_m(tt1, tt2)
    arcsec = 3600 * np.degrees(
        np.arctan2(np.linalg.norm(np.cross(geometric, apparent)), geometric @ apparent)
    )
    assert arcsec == pytest.approx(20.5, abs=0.4)
    # the shift is towards the Earth's motion, that is backwards along the Sun's apparent path
    assert (
        heliocentric["v"] @ (apparent / np.linalg.norm(apparent) - geometric / np.linalg.norm(geometric)) > 0
    )


def test_ephemerides_take_many_times_at_once():
    tt2 = np.array([0.0, 0.5, 1.0])
    for body in (sun_eci_m, moon_eci_m):
        assert np.allclose(body(2461120.0, tt2)[1], body(2461120.0, 0.5), rtol=1e-15)


def test_moon_agrees_with_meeus():
    """Meeus (1998), Astronomical Algorithms, example 47.a: 1992 April 12, 0h TD."""
    tt1, tt2 = 2448724.5, 0.0
    moon = erfa.ecm06(tt1, tt2) @ moon_eci_m(tt1, tt2)
    longitude = np.degrees(np.arctan2(moon[1], moon[0]))
    latitude = np.degrees(np.arcsin(moon[2] / np.linalg.norm(moon)))
    # Meeus folds the light time into his longitude
    assert longitude == pytest.approx(133.162655, abs=3e-4)
    assert latitude == pytest.approx(-3.229126, abs=3e-4)
    assert np.linalg.norm(moon) == pytest.approx(368_409.7e3, abs=2e3)


def test_earth_orientation_agrees_with_vallado():
    """Vallado (2013), example 3-14, UT1 and pole of the day included; 0.5 m are 0.01 arcsec."""
    t = Instant.from_utc("2004-04-06T07:51:28.386009Z")
    gcrs = np.array([5102.5089579, 6123.0114007, 6378.1369282]) * 1e3
    itrs = np.array([-1033.4793830, 7901.2952754, 6380.3565958]) * 1e3
    assert np.linalg.norm(R_itrs_from_eci(t) @ gcrs - itrs) < 0.5
    # he takes the value of 0 h for the whole day
    midnight = Instant.from_utc("2004-04-06T00:00:00Z")
    (ut1, ut1_part), (utc, utc_part) = midnight.ut1, midnight.utc
    assert ((ut1 - utc) + (ut1_part - utc_part)) * 86400 == pytest.approx(-0.4399619, abs=3e-5)


def test_node_regresses_at_the_secular_rate():
    """Vallado (2013), eq. 9-38: -3/2 n J2 (R/p)^2 cos i, to first order in J2 (1e-3)."""
    i = np.radians(98.2)
    a = EARTH_RADIUS_M + 700e3
    r, v = state_from_elements(
        Elements(semi_major_axis_m=a, eccentricity=0.001, inclination_rad=i, raan_rad=1.0)
    )
    n = np.sqrt(MU_EARTH_M3_S2 / a**3)
    turns = 10
    track = propagate(r, v, turns * 2 * np.pi / n, Gravity())
    # averaged over a turn at each end, so that the short-period swing drops out
    phase = np.linspace(0, 1, 64, endpoint=False)
    nodes = [
        np.mean([elements_from_state(*track(float((k + p) * 2 * np.pi / n))).raan_rad for p in phase])
        for k in (0, turns - 1)
    ]
    rate = (nodes[1] - nodes[0]) / ((turns - 1) * 2 * np.pi / n)
    secular = -1.5 * n * J2_EARTH * (EARTH_RADIUS_M / (a * (1 - 1e-6))) ** 2 * np.cos(i)
    assert rate == pytest.approx(secular, rel=0.005)
    # sun-synchronous: a turn a year
    assert np.degrees(rate) * 86400 == pytest.approx(360 / 365.2422, rel=0.02)


def test_axisymmetric_tumble_is_a_regular_precession():
    """Wertz (1978), sec. 16.2: the rate cones about the axis at (J3 - J1)/J1 w3, the body about L."""
    J1, J3 = 2.5, 3.9
    w = np.array([0.03, 0.0, 0.02])
    track = propagate_attitude([1, 0, 0, 0], w, np.diag([J1, J1, J3]), 600.0)
    L = np.array([J1 * w[0], 0.0, J3 * w[2]])
    coning, precession = (J3 - J1) / J1 * w[2], np.linalg.norm(L) / J1
    for t in np.linspace(0, 600, 31):
        q, rate = track(float(t))
        expected = [w[0] * np.cos(coning * t), w[0] * np.sin(coning * t), w[2]]
        assert np.allclose(rate, expected, atol=1e-10, rtol=0)
        about_momentum = quat_from_rotvec(precession * t * L / np.linalg.norm(L))
        about_axis = quat_from_rotvec([0, 0, -coning * t])
        assert rotation_angle_rad(q, quat_multiply(about_momentum, about_axis)) < 1e-8
