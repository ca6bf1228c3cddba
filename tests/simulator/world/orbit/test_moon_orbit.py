"""Lunar orbit: forces against a geocentric propagation, eclipse by the Moon, the scene's record."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.checks import check_document
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.bodies.moon import MOON
from flyaround.simulator.world.constants import AU_M, MOON_RADIUS_M, SOLAR_PRESSURE_PA
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.ephemeris.moon_orientation import R_moon_from_eci
from flyaround.simulator.world.flight.export import flight_messages
from flyaround.simulator.world.orbit.forces import EarthForces, Forces, Surface
from flyaround.simulator.world.orbit.moon_forces import MoonForces, lunar_degree_2
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.time.instant import Instant
from tests.harness.oem import oem_state

EPOCH = Instant.from_utc("2024-06-06T05:00:00Z")
HOUR = 3600.0


def test_the_same_orbit_comes_out_of_a_propagation_about_the_earth():
    sky = EphemerisTable.build(EPOCH, HOUR)
    r, v = state_from_elements(
        Elements(semi_major_axis_m=4e6, eccentricity=0.1, inclination_rad=2.0), MOON.mu_m3_s2
    )
    about_moon = propagate(r, v, HOUR, MoonForces(epoch=EPOCH, sky=sky, forces=Forces(sun=True)))
    r0, v0 = MOON.geocentric_state(EPOCH)
    about_earth = propagate(r0 + r, v0 + v, HOUR, EarthForces(sky=sky, forces=Forces(sun=True, moon=True)))
    there, _ = MOON.geocentric_state(EPOCH.plus(HOUR))
    ours = about_moon(HOUR)[0]
    # the Earth's tide moves the craft by 200 m; the Moon's series is smooth to some 10 m
    without = propagate(r, v, HOUR, _OnlyMoon())(HOUR)[0]
    assert np.linalg.norm(ours - without) > 150.0
    apart = np.linalg.norm(there + ours - about_earth(HOUR)[0])
    assert apart < 25.0


def test_light_pushes_a_lunar_craft_only_where_it_is_asked_for_and_lit():
    """Montenbruck & Gill, eq. 3.75; behind the Moon there is none, and the chaser's is its own."""
    sky = EphemerisTable.build(EPOCH, HOUR)
    craft = (Surface(mass_kg=50.0, area_m2=0.5), Surface(mass_kg=5.0, area_m2=0.5))
    _, sun_from_earth, moon = sky.at(0.0)
    away = -(sun_from_earth - moon) / np.linalg.norm(sun_from_earth - moon)
    still, aside = np.zeros(3), np.array([0.0, 0.0, 10.0])
    bare = MoonForces(epoch=EPOCH, sky=sky, forces=Forces(target=craft[0], chaser=craft[1]))
    lit = MoonForces(
        epoch=EPOCH, sky=sky, forces=Forces(target=craft[0], chaser=craft[1], solar_pressure=True)
    )
    for r, seen in ((-4e6 * away, 1.0), (4e6 * away, 0.0)):
        (a, d), (a0, d0) = (f.pair(0.0, r, still, aside, still) for f in (lit, bare))
        distance = np.linalg.norm(sun_from_earth - moon - r)
        push = seen * SOLAR_PRESSURE_PA * 1.3 * 0.5 / 50.0 * (AU_M / distance) ** 2 * away
        assert a - a0 == pytest.approx(push, rel=1e-4, abs=1e-15)
        assert d - d0 == pytest.approx(9 * push, rel=1e-4, abs=1e-15)
    # a craft's surface alone pushes nothing
    assert np.array_equal(
        bare.target(0.0, 4e6 * away, still), MoonForces(epoch=EPOCH, sky=sky).target(0.0, 4e6 * away, still)
    )


class _OnlyMoon:
    mu_m3_s2 = MOON.mu_m3_s2
    solar_pressure = False

    def target(self, _t, r, _v):
        return -self.mu_m3_s2 * r / np.linalg.norm(r) ** 3


def test_flattening_turns_the_node_at_the_rate_of_its_formula():
    J2 = 203.22e-6
    a, i = MOON_RADIUS_M + 200e3, np.radians(60.0)
    R = R_moon_from_eci(EPOCH)
    r, v = state_from_elements(Elements(semi_major_axis_m=a, inclination_rad=i), MOON.mu_m3_s2)
    n = np.sqrt(MOON.mu_m3_s2 / a**3)
    span = 4 * 2 * np.pi / n
    forces = MoonForces(epoch=EPOCH, sky=EphemerisTable.build(EPOCH, span), forces=Forces(gravity_degree=2))
    plain = MoonForces(epoch=EPOCH, sky=EphemerisTable.build(EPOCH, span))

    def node(f, t):
        track = propagate(R.T @ r, R.T @ v, span, f)
        h = R @ np.cross(*track(t))
        return float(np.arctan2(h[0], -h[1]))

    turned = node(forces, span) - node(plain, span)
    expected = -1.5 * n * J2 * (MOON_RADIUS_M / a) ** 2 * np.cos(i) * span
    # the bulge towards the Earth, a tenth of it, turns under the orbit and does not average out in a day
    assert turned == pytest.approx(expected, rel=0.35)


def test_scene_has_the_moon_where_the_orbit_is_about_it():
    plan = plan_flight(load_scenario("lunar-orbit"), n=3)
    for k in range(3):
        s = plan.scene(k)
        height = np.linalg.norm(np.subtract(s.r_camera_eci_m, s.central.r_eci_m)) - MOON_RADIUS_M
        assert 150e3 < height < 250e3
        assert 3.5e8 < np.linalg.norm(s.central.r_eci_m) < 4.1e8
        assert s.central_body == "moon"
        R = R_moon_from_eci(Instant.from_utc(s.epoch_utc))
        assert np.allclose(s.central.R_fixed_from_eci, R, atol=1e-9)
    world = plan.flight.state(200.0)
    assert world.altitude_m == pytest.approx(198e3, abs=5e3)
    # radially outward of LVLH is away from the Moon
    above = plan.flight.lvlh(200.0).R_eci_from_lvlh[:, 0]
    out = np.subtract(world.r_target_eci_m, world.central.r_eci_m)
    assert above @ out / np.linalg.norm(out) == pytest.approx(1.0)


def test_the_moon_and_the_earth_hide_the_sun():
    sun, moon = np.array([AU_M, 0.0, 0.0]), np.array([0.0, 3.8e8, 0.0])
    low = np.array([MOON_RADIUS_M + 100e3, 0.0, 0.0])
    assert sun_fraction_past_bodies(earth_and_moon(vec3(moon)), moon + low, sun) == 1.0
    assert sun_fraction_past_bodies(earth_and_moon(vec3(moon)), moon - low, sun) == 0.0
    # an eclipse of the Moon: its day side lies in the Earth's shadow
    behind = np.array([-3.8e8, 0.0, 0.0])
    assert sun_fraction_past_bodies(earth_and_moon(vec3(behind)), behind + low, sun) == 0.0
    # an annular or total eclipse of the Sun seen from an Earth orbit
    before = np.array([3.6e8, 0.0, 0.0])
    assert sun_fraction_past_bodies(earth_and_moon(vec3(before)), np.array([7e6, 0.0, 0.0]), sun) < 0.02


def test_messages_count_from_the_moon():
    flight = plan_flight(load_scenario("lunar-orbit"), n=1).flight
    text = flight_messages(flight, [0.0, 60.0, 120.0], aem=False)["target.oem"]
    assert "CENTER_NAME = MOON" in text
    epoch = flight.epoch.plus(60.0)
    r, v = oem_state(text, "target.oem", epoch, "MOON")
    assert np.allclose(r, flight.orbit(60.0)[0], atol=1e-3)
    assert np.allclose(v, flight.orbit(60.0)[1], atol=1e-6)
    with pytest.raises(UserError, match="CENTER_NAME is MOON, allowed: EARTH"):
        oem_state(text, "target.oem", epoch)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"gravity_degree": 20}, "gravity_degree is 20, allowed about the Moon: 0 or 2"),
        ({"drag": True}, "forces.drag is true, but it needs air"),
        ({"moon": True}, "forces.moon is true, but it is the centre"),
    ],
)
def test_forces_that_the_moon_lacks_are_refused(change, says):

    scenario = load_scenario("lunar-orbit")
    forces = msgspec.structs.replace(scenario.forces, **change)
    with pytest.raises(UserError, match=says):
        check_document(msgspec.structs.replace(scenario, forces=forces), "mine.toml")


@pytest.mark.parametrize("about_moon", [True, False])
def test_forces_at_a_time_are_those_of_a_flight_that_starts_then(about_moon):
    """All that turns and moves meanwhile: the Moon's bulge, the Earth with its harmonics, Sun and Moon."""
    later_s = 2 * 86400.0
    forces = Forces(gravity_degree=2, sun=True, moon=True)

    def model(epoch, span_s):
        sky = EphemerisTable.build(epoch, span_s)
        if about_moon:
            return MoonForces(epoch=epoch, sky=sky, forces=forces)
        return EarthForces(sky=sky, forces=forces, harmonics=lunar_degree_2())

    r, v = np.array([1.2e6, -0.9e6, 1.1e6]), np.array([900.0, 1100.0, -80.0])
    p, w = np.array([300.0, 200.0, -100.0]), np.zeros(3)
    once, again = (
        model(epoch, 3 * 86400.0).pair(t, r, v, p, w)
        for epoch, t in ((EPOCH, later_s), (EPOCH.plus(later_s), 0.0))
    )
    for a, b in zip(once, again, strict=True):
        assert np.linalg.norm(a - b) < 1e-8 * np.linalg.norm(a)
