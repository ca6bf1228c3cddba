"""The Earth map's track: places against the world's own propagation, shadow to the second, terminator by its Sun."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flyaround.gui.picture.ground_map import HEIGHT_PX, WIDTH_PX, GroundMap
from flyaround.simulator.piloting.ground_track import (
    GroundTrack,
    geodetic_deg,
    ground_track,
    split_at_map_edge,
    subsolar_deg,
    terminator_deg,
)
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.viewpoint import place_itrs_m
from flyaround.simulator.world.bodies.earth import EARTH


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-eclipse-pass"))


@pytest.fixture(scope="module")
def track(session: FlightSession) -> GroundTrack:
    return ground_track(session.flight, 0.0)


@given(latitude=st.floats(-89, 89), longitude=st.floats(-179, 179), altitude_km=st.floats(150, 2000))
def test_a_place_is_found_again(latitude: float, longitude: float, altitude_km: float) -> None:
    r, _ = place_itrs_m(latitude, longitude, altitude_km)
    found = geodetic_deg(r, EARTH)
    assert found[0] == pytest.approx(latitude, abs=1e-4)
    assert found[1] == pytest.approx(longitude, abs=1e-9)


def test_the_next_orbit_is_that_of_the_worlds_own_propagation(
    session: FlightSession, track: GroundTrack
) -> None:
    for t in (600.0, 2400.0, 5400.0):
        state = session.flight.state(t)
        fixed = state.body("earth").R_fixed_from_eci @ np.array(state.r_target_eci_m)
        latitude, longitude = geodetic_deg(fixed, EARTH)
        k = track.times_s
        assert np.interp(t, k, track.latitude_deg) == pytest.approx(float(latitude), abs=0.1)
        assert np.interp(t, k, np.unwrap(track.longitude_deg, period=360)) % 360 == pytest.approx(
            float(longitude) % 360, abs=0.3
        )


def test_shadow_comes_and_goes_when_it_does(session: FlightSession, track: GroundTrack) -> None:
    assert track.enters_s is not None
    assert track.leaves_s is not None
    seen = [
        session.flight.state(t).sun_visible_fraction for t in (track.enters_s - 1.5, track.enters_s + 1.5)
    ]
    assert seen[0] == 1.0 > seen[1]
    seen = [
        session.flight.state(t).sun_visible_fraction for t in (track.leaves_s - 1.5, track.leaves_s + 1.5)
    ]
    assert seen[0] < 1.0 == seen[1]
    inside = (track.times_s > track.enters_s + 30) & (track.times_s < track.leaves_s - 30)
    assert np.all(track.sunlit[inside] == 0.0)


def test_an_orbit_in_sunlight_has_no_shadow_to_come() -> None:
    flight = FlightSession.of(load_scenario("geo-inspection")).flight
    track = ground_track(flight, 0.0)
    assert (track.enters_s, track.leaves_s) == (None, None)
    # it stands over one place
    assert np.ptp(track.latitude_deg) < 5.0
    assert np.ptp(np.unwrap(track.longitude_deg, period=360)) < 5.0


def test_about_the_moon_the_ground_is_the_moons() -> None:
    flight = FlightSession.of(load_scenario("lunar-orbit")).flight
    track = ground_track(flight, 0.0)
    assert track.times_s[-1] == pytest.approx(7000.0, rel=0.2)


@given(latitude=st.floats(-23.4, 23.4), longitude=st.floats(-179, 179))
def test_on_the_terminator_the_sun_is_on_the_horizon(latitude: float, longitude: float) -> None:
    lat, lon = (np.radians(x) for x in terminator_deg(latitude, longitude))
    sun = np.radians([latitude, longitude])
    height = np.sin(lat) * np.sin(sun[0]) + np.cos(lat) * np.cos(sun[0]) * np.cos(lon - sun[1])
    assert np.nanmax(np.abs(height)) < 1e-7
    assert np.isfinite(lat).sum() > 200


def test_a_line_over_the_date_line_is_broken_there() -> None:
    latitude, longitude = split_at_map_edge(np.array([0.0, 1.0, 2.0]), np.array([178.0, -179.0, -175.0]))
    assert np.isnan(latitude[1])
    assert longitude[[0, 2, 3]].tolist() == [178.0, -179.0, -175.0]


def test_below_the_sun_it_is_day_and_opposite_night() -> None:
    day, night = (np.full((HEIGHT_PX, WIDTH_PX, 3), v, np.float32) for v in (200, 10))
    lit = GroundMap(day, night).lit(20.0, -90.0)
    row, column = round((90 - 20) * HEIGHT_PX / 180), WIDTH_PX // 4
    assert lit[row, column, 0] == 200
    assert lit[HEIGHT_PX - row, (column + WIDTH_PX // 2) % WIDTH_PX, 0] == 10
    assert subsolar_deg(np.array([0.0, -5.0, 0.0]), np.eye(3)) == pytest.approx((0.0, -90.0))
