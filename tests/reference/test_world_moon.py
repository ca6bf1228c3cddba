"""Orientation of the Moon against a published libration, and against what keeps its face to the Earth."""

from __future__ import annotations

import numpy as np

from simulator.world.ephemeris import moon_geometric_m
from simulator.world.moon import R_moon_from_eci, q_moon_from_eci
from simulator.world.rotation import matrix_from_quat
from simulator.world.time import Instant


def earth_seen_deg(t: Instant) -> np.ndarray:
    """Selenographic longitude and latitude of the Earth: the libration."""
    x, y, z = R_moon_from_eci(t) @ -moon_geometric_m(t.tt1, t.tt2)
    return np.degrees([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])


def test_libration_agrees_with_meeus() -> None:
    """Meeus (1998), example 53.a: 1992 April 12, 0h TD: -1.23 and +4.20 deg, physical libration included."""
    assert np.allclose(earth_seen_deg(Instant(2448724.5, 0.0)), [-1.23, 4.20], atol=0.03)


def test_face_stays_to_the_earth() -> None:
    """Optical libration: at most 8.2 deg in longitude and 6.9 in latitude, and it comes close to both."""
    seen = np.array([earth_seen_deg(Instant(2461000.0, float(d))) for d in np.arange(0, 2200, 0.7)])
    assert np.all(np.abs(seen[:, 0]) < 8.3)
    assert np.all(np.abs(seen[:, 1]) < 7.0)
    assert np.abs(seen).max(axis=0).min() > 6.5
    assert abs(seen[:, 0].mean()) < 0.1


def test_quaternion_is_the_matrix() -> None:
    t = Instant(2461000.0, 0.3)
    assert np.allclose(matrix_from_quat(q_moon_from_eci(t)), R_moon_from_eci(t), atol=1e-14)
