"""Eclipse: full Sun, umbra, a continuous penumbra, and agreement with the drawn Earth."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.flight import fly
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.constants import AU_M, EARTH_RADIUS_M, MOON_RADIUS_M, SUN_RADIUS_M
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.ephemeris.eclipse import (
    sun_fraction_past_bodies,
    sun_fraction_past_earth,
    sun_fraction_past_sphere,
)
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.orbit.forces import EarthForces, Forces, Surface
from flyaround.simulator.world.time.instant import Instant

SUN = np.array([AU_M, 0.0, 0.0])


def along_the_shadow_edge(heights_m):
    """Positions 2,000 km behind the Earth's terminator plane at these distances from the shadow's axis."""
    return np.stack([np.full_like(heights_m, -2e6), heights_m, np.zeros_like(heights_m)], axis=-1)


def test_fraction_rises_from_umbra_to_sunlight():
    heights = EARTH_RADIUS_M + np.linspace(-30e3, 30e3, 601)
    fraction = sun_fraction_past_earth(along_the_shadow_edge(heights), SUN)
    assert fraction[0] == 0.0
    assert fraction[-1] == 1.0
    assert np.all(np.diff(fraction) >= 0)
    partial = (fraction > 0) & (fraction < 1)
    # the penumbra is as wide as the Sun's disc seen over the distance from the limb
    width = np.ptp(heights[partial])
    assert width == pytest.approx(2e6 * 2 * SUN_RADIUS_M / AU_M, rel=0.02)
    # half the disc is hidden where the limb passes its centre
    assert heights[np.argmin(abs(fraction - 0.5))] == pytest.approx(EARTH_RADIUS_M, abs=200)


def test_far_behind_the_umbra_the_eclipse_is_annular():
    distance = 3e9
    fraction = sun_fraction_past_earth([-distance, 0, 0], SUN)
    ratio = (EARTH_RADIUS_M / distance) / (SUN_RADIUS_M / (AU_M + distance))
    assert fraction == pytest.approx(1 - ratio**2, abs=1e-4)


def test_area_agrees_with_counting_points_of_the_disc():
    """The same overlap by casting rays from the spacecraft to points of the Sun's disc."""
    r = along_the_shadow_edge(np.array([EARTH_RADIUS_M - 4e3]))[0]
    rng = np.random.default_rng(1)
    radius, angle = SUN_RADIUS_M * np.sqrt(rng.random(200_000)), 2 * np.pi * rng.random(200_000)
    points = SUN + np.stack([np.zeros_like(radius), radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    d = points - r
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    miss = np.linalg.norm(r - (d @ r)[:, None] * d, axis=-1) > EARTH_RADIUS_M
    assert sun_fraction_past_earth(r, SUN) == pytest.approx(np.mean(miss), abs=0.004)


def seen_past_the_ellipsoid(r, sun, pole, side=240):
    """Share of a square grid of the Sun's disc whose rays from ``r`` miss the WGS 84 ellipsoid about ``pole``."""
    to_sun = sun - r
    u = to_sun / np.linalg.norm(to_sun)
    e1 = np.cross(u, [0.3, 0.5, 0.8])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(u, e1)
    grid = (np.arange(side) + 0.5) / side * 2 - 1
    y, z = (v.ravel() for v in np.meshgrid(grid, grid))
    y, z = (v[y * y + z * z < 1] * 6.957e8 for v in (y, z))
    d = to_sun + y[:, None] * e1 + z[:, None] * e2
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    # |P x|^2 = 1 on the ellipsoid: a quadratic equation along each ray
    a, b = 6_378_137.0, 6_356_752.3142
    axis = np.eye(3) / a + np.outer(pole, pole) * (1 / b - 1 / a)
    q, w = axis @ r, d @ axis
    qw, ww = w @ q, np.einsum("ij,ij->i", w, w)
    hit = (qw < 0) & (qw**2 - ww * (q @ q - 1) > 0)
    return float(1 - hit.mean())


def half_light_s(light_at, start_s, end_s):
    """When half of the disc is seen, between a lit and a dark moment in any order."""
    rising = light_at(end_s) > 0.5
    for _ in range(24):
        middle = (start_s + end_s) / 2
        if (light_at(middle) > 0.5) == rising:
            end_s = middle
        else:
            start_s = middle
    return (start_s + end_s) / 2


@pytest.mark.parametrize("sun_dec_deg", [0.0, 23.4])
@pytest.mark.parametrize("tilt_deg", [0.0, 0.15])
def test_a_polar_orbit_goes_into_the_shadow_of_the_ellipsoid(sun_dec_deg, tilt_deg):
    dec, tilt = np.radians([sun_dec_deg, tilt_deg])
    sun = AU_M * np.array([np.cos(dec), 0.0, np.sin(dec)])
    pole = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    radius, speed = EARTH_RADIUS_M + 700e3, 7504.0

    def place(t_s):
        angle = speed * t_s / radius
        return radius * np.array([np.cos(angle), 0.0, np.sin(angle)])

    # over the north pole into the shadow
    for t in np.linspace(1200, 2300, 12):
        r = place(t)
        assert sun_fraction_past_earth(r, sun, pole) == pytest.approx(
            seen_past_the_ellipsoid(r, sun, pole, 100), abs=0.02
        )
    ours = half_light_s(lambda t: float(sun_fraction_past_earth(place(t), sun, pole)), 1000.0, 2960.0)
    rays = half_light_s(lambda t: seen_past_the_ellipsoid(place(t), sun, pole, 60), 1000.0, 2960.0)
    sphere = half_light_s(
        lambda t: float(sun_fraction_past_sphere(place(t), sun, EARTH_RADIUS_M)), 1000.0, 2960.0
    )
    assert ours == pytest.approx(rays, abs=0.05)
    # what the flattening is worth there: the 21 km that the pole is lower, at 7.5 km/s across a slanting limb
    assert 3.0 < ours - sphere < 7.0
    for t in rays + np.linspace(-4, 4, 9):
        r = place(t)
        assert sun_fraction_past_earth(r, sun, pole) == pytest.approx(
            seen_past_the_ellipsoid(r, sun, pole), abs=0.004
        )


def test_flight_light_pressure_and_drawn_earth_have_one_shadow():
    """In a polar orbit, where the Earth that is drawn (WGS 84 in ITRS) hides half of the Sun."""
    scenario = load_scenario("tango-eclipse-pass")
    orbit = msgspec.structs.replace(scenario.orbit, inclination_deg=90.0, raan_deg=178.0)
    flight = fly(msgspec.structs.replace(scenario, orbit=orbit, duration_s=5900.0), load_target("tango@low"))
    times = np.linspace(0, 5900, 60)
    light = np.array([flight.state(t).sun_visible_fraction for t in times])
    edges = np.flatnonzero(np.diff(light > 0.5))
    assert len(edges) == 2
    craft = Surface(mass_kg=100.0, area_m2=1.0)
    epoch = Instant.from_utc(flight.state(0.0).epoch_utc)
    push = EarthForces(
        sky=EphemerisTable.build(epoch, 5900.0),
        forces=Forces(solar_pressure=True, target=craft, chaser=craft),
    )
    pull = EarthForces(sky=push.sky)
    for k in edges:
        t = half_light_s(lambda t: flight.state(t).sun_visible_fraction, times[k], times[k + 1])
        for dt in (-3.0, 0.0, 3.0):
            state = flight.state(t + dt)
            r, sun = np.array(state.r_target_eci_m), np.array(state.r_sun_eci_m)
            pole = state.central.R_fixed_from_eci[2]
            rays = seen_past_the_ellipsoid(r, sun, pole, 160)
            assert state.sun_visible_fraction == pytest.approx(rays, abs=0.006)
            # the forces take the geometric Sun, 20 arc seconds from the apparent one
            v, geometric = np.zeros(3), push.sky.at(t + dt)[1]
            rays = seen_past_the_ellipsoid(r, geometric, pole, 160)
            light_pressure = np.linalg.norm(push.target(t + dt, r, v) - pull.target(t + dt, r, v))
            full = 1361 / 299792458.0 * 1.3 / 100 * (AU_M / np.linalg.norm(geometric - r)) ** 2
            assert light_pressure / full == pytest.approx(rays, abs=0.006)


@pytest.mark.parametrize("earth_height_m", [EARTH_RADIUS_M + 1.5e3, EARTH_RADIUS_M + 60e3])
def test_what_earth_and_moon_hide_of_the_sun_is_added(earth_height_m):
    """The Earth's limb hides the disc from below, the Moon from above; against rays to points of the disc."""
    r = np.array([-2e6, earth_height_m, 0.0])
    to_sun = (SUN - r) / np.linalg.norm(SUN - r)
    up = np.cross([0.0, 0.0, 1.0], to_sun)
    sun_rad, moon_m = SUN_RADIUS_M / AU_M, 3.9e8
    # the Moon's centre so high that its limb is half a solar radius above the Sun's centre
    above = MOON_RADIUS_M / moon_m + 0.5 * sun_rad
    moon = r + moon_m * (np.cos(above) * to_sun + np.sin(above) * up)
    rng = np.random.default_rng(2)
    radius, angle = SUN_RADIUS_M * np.sqrt(rng.random(100_000)), 2 * np.pi * rng.random(100_000)
    d = SUN - r + radius[:, None] * (np.cos(angle)[:, None] * up + np.sin(angle)[:, None] * [0.0, 0.0, 1.0])
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    by_earth, by_moon = (
        np.linalg.norm(body - (d @ body)[:, None] * d, axis=-1) < size
        for body, size in ((-r, EARTH_RADIUS_M), (moon - r, MOON_RADIUS_M))
    )
    assert 0.1 < by_moon.mean() < 0.4
    assert not np.any(by_earth & by_moon)
    found = sun_fraction_past_bodies(earth_and_moon(vec3(moon)), r, SUN)
    # of a hundred thousand points: three sigma of the count
    assert found == pytest.approx(np.mean(~by_earth & ~by_moon), abs=0.005)


def test_full_shade_of_either_body_is_full_shade():
    """With nothing left by the Earth and a part hidden by the Moon too, the share is zero and not less."""
    r = np.array([-2e6, 0.0, 0.0])
    moon = r + 3.9e8 * np.array([np.cos(0.008), np.sin(0.008), 0.0])
    assert sun_fraction_past_bodies(earth_and_moon(vec3(moon)), r, SUN) == 0.0
