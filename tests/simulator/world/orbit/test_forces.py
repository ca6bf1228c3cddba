"""Forces: gravity harmonics against their potential, drag, radiation pressure, third bodies, cancellation."""

from itertools import pairwise
from math import factorial, sqrt

import erfa
import numpy as np
import pytest
from scipy.special import lpmv

from flyaround.simulator.world.constants import AU_M, EARTH_RADIUS_M, MU_MOON_M3_S2, SOLAR_PRESSURE_PA
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci, pole_eci
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_m
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.orbit.forces import (
    _AIR_LAYERS,
    EarthForces,
    Forces,
    Surface,
    attraction,
    attraction_difference,
    density_kg_m3,
    geodetic_altitude_m,
)
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.orbit.spherical_harmonics import _coefficients, egm96, harmonic_field
from flyaround.simulator.world.time.instant import Instant

EPOCH = Instant.from_utc("2025-03-21T06:00:00Z")
SKY = EphemerisTable.build(EPOCH, 86400.0)
R0, V0 = state_from_elements(
    Elements(semi_major_axis_m=EARTH_RADIUS_M + 600e3, inclination_rad=1.7, raan_rad=0.4)
)
SMALL = Surface(mass_kg=50.0, area_m2=0.5)


def potential(r, degree):
    """The textbook sum with scipy's Legendre functions (Montenbruck & Gill, eq. 3.27)."""
    mu, radius, C, S = _coefficients()
    x, y, z = r
    distance, longitude = np.linalg.norm(r), np.arctan2(y, x)
    total = 0.0
    for n in range(2, degree + 1):
        for m in range(n + 1):
            norm = sqrt((1 if m == 0 else 2) * (2 * n + 1) * factorial(n - m) / factorial(n + m))
            P = (-1) ** m * lpmv(m, n, z / distance) * norm
            wave = C[n, m] * np.cos(m * longitude) + S[n, m] * np.sin(m * longitude)
            total += mu / distance * (radius / distance) ** n * P * wave
    return float(total)


@pytest.mark.parametrize("degree", [2, 5, 20])
def test_acceleration_is_the_gradient_of_the_potential(degree):
    points = np.array([[4e6, -3e6, 4.9e6], [-6.9e6, 1e5, -3e5]])
    h = 100.0
    for r, a in zip(points, egm96(degree).acceleration(points), strict=True):
        gradient = [
            (8 * (potential(r + h * e, degree) - potential(r - h * e, degree))
             - potential(r + 2 * h * e, degree) + potential(r - 2 * h * e, degree)) / (12 * h)
            for e in np.eye(3)
        ]  # fmt: skip
        assert np.allclose(a, gradient, atol=2e-12, rtol=0)


def test_nothing_is_singular_at_the_pole():
    a = egm96(70).acceleration(np.array([[0.0, 0.0, 7e6], [1e-3, 0.0, 7e6]]))
    assert np.all(np.isfinite(a))
    assert np.allclose(a[0], a[1], atol=1e-12)


def test_zonal_part_is_the_closed_form_of_j2():
    """``J2 = -sqrt(5) C20``; the closed form knows any pole, the harmonics the Earth's."""
    C, S = np.zeros((3, 3)), np.zeros((3, 3))
    g = Gravity()
    C[2, 0] = -g.j2 / np.sqrt(5)
    r = np.array([3e6, -5e6, 4e6])
    whole = harmonic_field(g.mu_m3_s2, g.radius_m, C, S).acceleration(r[None])[0] + attraction(
        r.tolist(), g.mu_m3_s2
    )
    assert np.allclose(whole, g.acceleration(r), rtol=1e-13)


@pytest.mark.parametrize("degree", [1, 71])
def test_degree_beyond_the_coefficients_is_refused(degree):
    with pytest.raises(ValueError, match="2 to 70"):
        egm96(degree)


def test_table_of_the_sky_is_the_routines_it_replaces():
    for t in (0.0, 901.0, 43210.0, 86400.0):
        R, _, moon = SKY.at(t)
        now = EPOCH.plus(t)
        # the pole is held over the flight: it wanders by a milliarcsecond or two (1e-8 rad) a day
        assert np.allclose(R, R_itrs_from_eci(now), atol=1e-8, rtol=0)
        assert np.allclose(moon, moon_geometric_m(now.tt1, now.tt2), atol=0.05, rtol=0)
    assert np.allclose(SKY.at(0.0)[0], R_itrs_from_eci(EPOCH), atol=1e-13, rtol=0)


def test_difference_of_attraction_keeps_its_digits():
    r, p = R0.tolist(), [1e-3, 0.0, 0.0]
    d = np.array(attraction_difference(r, p, 3.986e14))
    n = R0 / np.linalg.norm(R0)
    linear = 3.986e14 / np.linalg.norm(R0) ** 3 * (3 * n * (n @ p) - p)
    assert np.allclose(d, linear, rtol=1e-8, atol=1e-18)
    far = np.array([2e5, -3e5, 1e5])
    whole = np.array(attraction((R0 + far).tolist(), 3.986e14)) - attraction(r, 3.986e14)
    assert np.allclose(attraction_difference(r, far.tolist(), 3.986e14), whole, atol=1e-14)


def test_moon_pulls_as_a_tide():
    forces = EarthForces(sky=SKY, forces=Forces(moon=True))
    moon = SKY.at(0.0)[2]
    added = forces.target(0.0, R0, V0) - EarthForces(sky=SKY).target(0.0, R0, V0)
    direct = (moon - R0) / np.linalg.norm(moon - R0) ** 3 - moon / np.linalg.norm(moon) ** 3
    assert np.allclose(added, MU_MOON_M3_S2 * direct, atol=1e-14, rtol=0)


def test_air_is_continuous_thins_and_slows_the_orbit():
    for (_, below, _), (base, density, _) in pairwise(_AIR_LAYERS):
        assert density_kg_m3(base * 1e3 - 1e-6) == pytest.approx(density, rel=0.01)
        assert density < below
    forces = EarthForces(sky=SKY, forces=Forces(drag=True, target=SMALL, chaser=SMALL))
    push = forces.target(0.0, R0, V0) - EarthForces(sky=SKY).target(0.0, R0, V0)
    assert push @ V0 < 0
    wind = V0 - 7.2921e-5 * np.cross(pole_eci(EPOCH), R0)
    expected = 0.5 * 1.454e-13 * 2.2 * 0.5 / 50.0 * (wind @ wind)
    assert np.linalg.norm(push) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("latitude_deg", [-90.0, -50.0, 0.0, 25.0, 45.0, 90.0])
@pytest.mark.parametrize("altitude_m", [150e3, 600e3])
def test_altitude_is_above_the_flattened_earth(latitude_deg, altitude_m):
    """SOFA's WGS 84; to first order in the flattening it is 25 m off at 45 degrees, a sphere 21 km at the pole."""
    r = erfa.gd2gc(1, 0.7, np.radians(latitude_deg), altitude_m)
    assert geodetic_altitude_m(r, float(r[2])) == pytest.approx(altitude_m, abs=1e-3)


def test_air_over_the_pole_is_that_of_the_height_above_the_pole():
    """Drag at one distance from the Earth's centre, over the pole and over the equator: 21 km differ in height."""
    pole = SKY.at(0.0)[0][2]
    across = np.cross(pole, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(pole, [1.0, 0.0, 0.0]))
    forces, bare = (
        EarthForces(sky=SKY, forces=Forces(drag=True, target=SMALL, chaser=SMALL)),
        EarthForces(sky=SKY),
    )
    distance, speed = EARTH_RADIUS_M + 400e3, 7600.0
    for at, way, latitude in ((pole, across, 90.0), (across, pole, 0.0)):
        r, v = distance * at, speed * way
        push = forces.target(0.0, r, v) - bare.target(0.0, r, v)
        height = distance - np.linalg.norm(erfa.gd2gc(1, 0.0, np.radians(latitude), 0.0))
        wind = v - 7.2921e-5 * np.cross(pole, r)
        expected = 0.5 * density_kg_m3(height) * 2.2 * 0.5 / 50.0 * (wind @ wind)
        assert np.linalg.norm(push) == pytest.approx(expected, rel=0.002)


def test_light_pushes_in_the_sun_and_not_in_the_shadow():
    sun = SKY.at(0.0)[1]
    away = sun / np.linalg.norm(sun)
    forces = EarthForces(sky=SKY, forces=Forces(solar_pressure=True, target=SMALL, chaser=SMALL))
    bare = EarthForces(sky=SKY)
    lit, dark = 7e6 * away, -7e6 * away
    push = forces.target(0.0, lit, V0) - bare.target(0.0, lit, V0)
    expected = SOLAR_PRESSURE_PA * 1.3 * 0.5 / 50.0 * (AU_M / np.linalg.norm(sun - lit)) ** 2
    assert np.allclose(push, -expected * away, rtol=1e-6, atol=1e-14)
    assert np.array_equal(forces.target(0.0, dark, V0), bare.target(0.0, dark, V0))


@pytest.mark.parametrize(("sunlight", "tolerance_m"), [(False, 2e-6), (True, 1e-3)])
def test_two_craft_are_the_difference_of_two_flights(sunlight, tolerance_m):
    """Over an orbit, 10 m apart, against each propagated alone; steps straddle the edges of the shadow."""
    forces = EarthForces(
        sky=SKY,
        harmonics=egm96(8),
        forces=Forces(
            sun=True,
            moon=True,
            drag=True,
            solar_pressure=sunlight,
            target=SMALL,
            chaser=SMALL,
        ),
    )
    p, w = lvlh_frame(R0, V0, forces.target(0.0, R0, V0)).to_eci(np.array([1.0, -10.0, 2.0]), np.zeros(3))
    both = propagate(R0, V0, 5800.0, forces, (p, w))
    alone = propagate(R0 + p, V0 + w, 5800.0, forces)
    for t in (1000.0, 5800.0):
        assert np.allclose(both(t)[0] + both.relative(t)[0], alone(t)[0], atol=tolerance_m, rtol=0)


def test_lighter_chaser_is_blown_behind():
    light = Surface(mass_kg=5.0, area_m2=0.5)
    forces = EarthForces(sky=SKY, forces=Forces(drag=True, target=SMALL, chaser=light))
    nothing = (np.zeros(3), np.zeros(3))
    track = propagate(R0, V0, 300.0, forces, nothing)
    p, _ = track.relative(300.0)
    # ten times the drag: nine times the target's deceleration, over t^2/2
    own = 0.5 * 1.454e-13 * 2.2 * 0.5 / 50.0 * 7500.0**2
    assert p @ V0 / np.linalg.norm(V0) == pytest.approx(-9 * own * 300.0**2 / 2, rel=0.1)


def test_drag_of_the_chaser_is_that_of_its_own_velocity():
    """Beside the target and faster than it: the air alone tells them apart, as two craft flown each by itself."""
    forces = EarthForces(sky=SKY, forces=Forces(drag=True, target=SMALL, chaser=SMALL))
    for w in (100.0 * V0 / np.linalg.norm(V0), np.cross(R0, V0) / np.linalg.norm(R0)):
        _, apart = forces.pair(0.0, R0, V0, np.zeros(3), w)
        expected = forces.target(0.0, R0, V0 + w) - forces.target(0.0, R0, V0)
        # 1e-14: a sum of gravity's 8 m/s2 is rounded there
        assert np.linalg.norm(expected) > 1e-10
        assert np.allclose(apart, expected, rtol=0, atol=1e-14)
