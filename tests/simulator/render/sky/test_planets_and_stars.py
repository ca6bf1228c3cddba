"""Planets against the almanac, culling of stars, magnitudes as electrons."""

import erfa
import numpy as np
import pytest
from scipy.optimize import brentq

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.response import electrons_per_radiance
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.celestial.star_catalogue import star_irradiance_w_m2, stars
from flyaround.simulator.scene.illumination.planets import NAMES, planets
from flyaround.simulator.world.time.instant import Instant


def _at(ra_h, ra_m, dec_deg, dec_m):
    ra, dec = np.radians((ra_h + ra_m / 60) * 15), np.radians(dec_deg + np.copysign(dec_m, dec_deg) / 60)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def test_the_great_conjunction_of_2020():
    # Jupiter and Saturn 6.1 arc minutes apart on 2020-12-21 at 18:20 UTC, in Capricornus (RA 20 h 10 m, dec -20.5)
    seen = planets("2020-12-21T18:20:00Z", np.zeros(3))
    jupiter, saturn = (seen.directions[NAMES.index(name)] for name in ("Jupiter", "Saturn"))
    assert np.degrees(np.arccos(jupiter @ saturn)) * 60 == pytest.approx(6.1, abs=1.5)
    assert np.degrees(np.arccos(jupiter @ _at(20, 10, -20, 33))) < 0.3
    assert seen.v_mag[NAMES.index("Jupiter")] == pytest.approx(-2.0, abs=0.15)


def test_magnitudes_of_mars_and_venus():
    # Mars at its opposition of 2020-10-13: -2.6; Venus at greatest brilliancy 2020-04-28: -4.7 to -4.5
    assert planets("2020-10-13T23:00:00Z", np.zeros(3)).v_mag[NAMES.index("Mars")] == pytest.approx(
        -2.6, abs=0.15
    )
    assert planets("2020-04-28T01:00:00Z", np.zeros(3)).v_mag[NAMES.index("Venus")] == pytest.approx(
        -4.6, abs=0.2
    )


@pytest.mark.parametrize("angle_deg", [3.0, 20.0, 120.0])
def test_no_star_in_view_is_lost_by_sorting(angle_deg):
    field = stars("2026-01-01T00:00:00Z", "mono")
    assert field.directions.shape[1] > 78_000
    rng = np.random.default_rng(5)
    for _ in range(20):
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        inside = axis @ field.directions > np.cos(np.radians(angle_deg))
        found, light = field.near(axis, np.radians(angle_deg))
        kept = axis @ found > np.cos(np.radians(angle_deg))
        # the order is the field's own
        assert np.array_equal(found[:, kept], field.directions[:, inside])
        assert np.array_equal(light[:, kept], field.irradiance_w_m2[:, inside])
        assert found.shape[1] < inside.sum() * (1 + 30 / angle_deg) + 500


def test_magnitude_as_electrons():
    """A star of Hp 5 through a lens of 17.6 mm f-length f/2: photons counted by hand."""
    light = star_irradiance_w_m2(np.array([5.0]), np.array([0.65]), "mono")[0, 0]
    pitch, focal, number, exposure = 5.86e-6, 17.6e-3, 2.0, 0.5
    sensor = Sensor(
        detector=Detector(quantum_efficiency=(0.5,)), pixel_pitch_x_m=pitch, pixel_pitch_y_m=pitch
    )
    optics = Optics(f_number=number, transmission=1.0)
    # radiance that a pixel's solid angle must have to hold the star
    electrons = electrons_per_radiance(sensor, optics, exposure, 1) * light / (pitch / focal) ** 2
    # V = 0 is 3.63e-9 erg s-1 cm-2 A-1 (Bessell 1998), which the Sun has in the mean over 278 nm of these 300; its
    # photons there are of 589 nm in the mean (both by ASTM E490)
    photons = 3.63e-11 * 278 * 10 ** (-0.4 * (5.0 - 0.13)) / (6.626e-34 * 2.998e8 / 589e-9)
    by_hand = photons * np.pi / 4 * (focal / number) ** 2 * exposure * 0.5
    assert float(np.squeeze(electrons)) == pytest.approx(by_hand, rel=0.02)


@pytest.mark.parametrize("epoch", ["2026-03-01T12:00:00Z", "2031-09-17T03:25:00Z"])
def test_planet_position_includes_light_time(epoch):
    """The moment it left is where the distance is the time since then: a root, found without iterating on places.

    With the light time's other sign Mercury is up to 65 arc seconds off, without it half of that.
    """
    now = Instant.from_utc(epoch)
    earth = erfa.epv00(now.tt1, now.tt2)[0]["p"]
    seen = planets(epoch, np.zeros(3))
    moved = []
    for name, number in zip(NAMES, (1, 2, 4, 5, 6), strict=True):

        def place(days, number=number):
            return erfa.plan94(now.tt1, now.tt2 - days, number)["p"] - earth

        left = brentq(lambda days: np.linalg.norm(place(days)) - days * 173.1446, 0.0, 0.1)
        from_sight = place(left) / np.linalg.norm(place(left))
        # one iteration is good to (v/c)^2, five thousandths of a second of arc
        off = np.arccos(np.clip(seen.directions[NAMES.index(name)] @ from_sight, -1, 1))
        assert np.degrees(off) * 3600 < 0.1
        moved.append(np.degrees(np.linalg.norm(np.cross(place(0.0), from_sight))) * 3600)
        moved[-1] /= np.linalg.norm(place(0.0))
    assert max(moved) > 5
