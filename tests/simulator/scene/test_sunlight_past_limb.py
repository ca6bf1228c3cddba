"""Sunlight past the Earth's limb: the disc's strips, the air that it passes, and the shadow that is left."""

import numpy as np
import pytest

from flyaround.simulator.scene.illumination.atmosphere import earth_atmosphere
from flyaround.simulator.scene.illumination.refraction import (
    sunlight_past_earth,
)
from flyaround.simulator.world.constants import SUN_RADIUS_M

AU_M = 149_597_870_700.0
RADIUS_M = 6_371_000.0


def test_a_craft_goes_through_half_light_into_the_shadow():
    sun = np.array([AU_M, 0.0, 0.0])
    behind = 2.5e6
    assert sunlight_past_earth(np.array([7e6, 0.0, 0.0]), sun, "mono") == pytest.approx(1.0)
    high = [
        float(sunlight_past_earth(np.array([-behind, 0.0, h + RADIUS_M]), sun, "mono")[0])
        for h in (400e3, 100e3)
    ]
    assert high[0] == pytest.approx(1.0)
    assert high[1] > 0.95
    shares = [
        float(sunlight_past_earth(np.array([-behind, 0.0, RADIUS_M + h]), sun, "mono")[0])
        for h in np.linspace(60e3, -60e3, 41)
    ]
    assert np.all(np.diff(shares) <= 1e-9)
    assert shares[0] > 0.9
    assert shares[-1] < 0.005
    # without air half the disc would be seen with its centre on the limb: air takes more, and only downwards
    half = behind * SUN_RADIUS_M / AU_M
    at_limb = float(sunlight_past_earth(np.array([-behind, 0.0, RADIUS_M]), sun, "mono")[0])
    assert at_limb < 0.4
    assert half < 15e3


def test_bent_light_is_spread_and_neither_lost_nor_made():
    """What enters between two heights lands between two others, however far behind: its sum is the same.

    The air bends the lower rays more, which dims the penumbra; 3e5 m behind the limb there is hardly any of that.
    """
    heights = np.linspace(-120e3, 200e3, 641)

    def landed(behind):
        sun = np.array([AU_M, 0.0, 0.0])
        air_radius = earth_atmosphere("mono").radius_m
        places = np.stack([np.full_like(heights, -behind), np.zeros_like(heights), heights + air_radius], 1)
        return float(np.mean([sunlight_past_earth(r, sun, "mono")[0] for r in places]))

    # steps of 500 m and a table whose steps are 100 m
    assert landed(2.6e6) == pytest.approx(landed(3e5), rel=5e-3)
