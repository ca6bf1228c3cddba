"""The Moon's light by distance and phase, from magnitudes and the inverse square, by hand."""

import numpy as np
import pytest

from flyaround.simulator.scene.illumination.irradiance import moon_plate_irradiance
from flyaround.simulator.scene.illumination.moonlight import moonlight_share

SUN = np.array([1.0, 0.0, 0.0])
# full Moon over the Sun: -12.73 and -26.74 (Allen 2000), at the mean distance of 384,400 km
AT_MEAN_DISTANCE = 10 ** (-0.4 * (-12.73 + 26.74))


@pytest.mark.parametrize("distance_km", [100_000, 356_500, 384_400, 406_700, 800_000])
def test_the_full_moon_s_light_falls_with_the_square_of_its_distance(distance_km):
    share = moonlight_share(-SUN * distance_km * 1e3, SUN)
    assert share == pytest.approx(AT_MEAN_DISTANCE * (384_400 / distance_km) ** 2, rel=0.01)


def test_perigee_is_thirty_per_cent_brighter_than_apogee():
    # 0.286 mag, as every almanac says
    near, far = (moonlight_share(-SUN * d, SUN) for d in (356.5e6, 406.7e6))
    assert 2.5 * np.log10(near / far) == pytest.approx(0.286, abs=0.003)


@pytest.mark.parametrize(("phase_deg", "magnitudes"), [(0.0, 0.0), (30.0, 0.78), (90.0, 2.60), (120.0, 3.95)])
def test_the_light_of_the_phases(phase_deg, magnitudes):
    # V(alpha) - V(0) = 0.026 alpha + 4e-9 alpha^4 (Allen 2000), worked out by hand
    a = np.radians(180 - phase_deg)
    share = moonlight_share(384.4e6 * np.array([np.cos(a), np.sin(a), 0.0]), SUN)
    assert -2.5 * np.log10(share / AT_MEAN_DISTANCE) == pytest.approx(magnitudes, abs=0.03)


def test_a_plate_near_the_moon_is_lit_by_the_square_too():
    sun_w_m2 = np.array([500.0])
    lit = [moon_plate_irradiance(-SUN * d, SUN, np.eye(3), sun_w_m2).max() for d in (192.2e6, 384.4e6)]
    assert lit[0] / lit[1] == pytest.approx(4.0, rel=1e-6)
    # the plates look in even directions: the best one is within some degrees of the Moon
    assert lit[1] == pytest.approx(500.0 * AT_MEAN_DISTANCE, rel=0.05)
