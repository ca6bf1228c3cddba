"""Orientation of the Moon against a published libration, and its synchronous rotation."""

import erfa
import numpy as np
import pytest

from flyaround.simulator.world.ephemeris.moon_orientation import _ARGUMENTS, R_moon_from_eci, q_moon_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_m
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.time.instant import Instant


def earth_seen_deg(t):
    """Selenographic longitude and latitude of the Earth: the libration."""
    x, y, z = R_moon_from_eci(t) @ -moon_geometric_m(t.tt1, t.tt2)
    return np.degrees([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])


def test_libration_agrees_with_meeus():
    """Meeus (1998), example 53.a: 1992 April 12, 0h TD: -1.23 and +4.20 deg, physical libration included."""
    assert np.allclose(earth_seen_deg(Instant(2448724.5, 0.0)), [-1.23, 4.20], atol=0.03)


def test_face_stays_to_the_earth():
    """Optical libration: at most 8.2 deg in longitude and 6.9 in latitude, and it comes close to both."""
    seen = np.array([earth_seen_deg(Instant(2461000.0, float(d))) for d in np.arange(0, 2200, 0.7)])
    assert np.all(np.abs(seen[:, 0]) < 8.3)
    assert np.all(np.abs(seen[:, 1]) < 7.0)
    assert np.abs(seen).max(axis=0).min() > 6.5
    assert abs(seen[:, 0].mean()) < 0.1


def test_quaternion_is_the_matrix():
    t = Instant(2461000.0, 0.3)
    assert np.allclose(matrix_from_quat(q_moon_from_eci(t)), R_moon_from_eci(t), atol=1e-14)


def test_arguments_are_sums_of_the_fundamental_ones():
    """Of the thirteen E, eleven are small whole multiples of Delaunay's arguments (IERS 2003, by SOFA).

    The node's rate is that of another theory, 4e-5 deg a day off for each time it is in the sum; E11 and E12 are
    planetary terms of the libration and have no such sum.
    """
    routines = (erfa.fal03, erfa.falp03, erfa.faf03, erfa.fad03, erfa.faom03)
    day = 1 / 36525.0
    start = np.degrees([f(0.0) for f in routines])
    rate = np.degrees([(f(day) - f(-day) + np.pi) % (2 * np.pi) - np.pi for f in routines]) / 2
    sums = {
        *((0, (0, 0, 0, 0, 1)), (1, (0, 0, 0, 0, 2)), (2, (1, 0, 0, 0, 1)), (3, (-1, 0, 2, 0, 1))),
        *((4, (0, 1, 0, 0, 0)), (5, (0, 0, 2, 0, 1)), (6, (1, 0, 0, 0, 0)), (7, (-2, 0, 2, 0, 0))),
        *((8, (2, 0, 0, -2, 0)), (9, (0, 0, 0, 0, 3)), (12, (1, 0, 0, 0, 2))),
    }
    for which, multiples in sums:
        there, a_day = _ARGUMENTS[which]
        assert abs((np.dot(multiples, start) - there + 180) % 360 - 180) < 1e-3
        assert a_day == pytest.approx(np.dot(multiples, rate), abs=2e-7 + 4e-5 * abs(multiples[4]))
