"""Eclipse: full Sun, umbra, and a penumbra that fades evenly from one to the other."""

from __future__ import annotations

import numpy as np
import pytest

from simulator.world.constants import AU_M, EARTH_RADIUS_M, SUN_RADIUS_M
from simulator.world.eclipse import sun_visible_fraction

SUN = np.array([AU_M, 0.0, 0.0])


def along_the_shadow_edge(heights_m: np.ndarray) -> np.ndarray:
    """Positions 2,000 km behind the Earth's terminator plane at these distances from the shadow's axis."""
    return np.stack([np.full_like(heights_m, -2e6), heights_m, np.zeros_like(heights_m)], axis=-1)


def test_fraction_rises_from_umbra_to_sunlight() -> None:
    heights = EARTH_RADIUS_M + np.linspace(-30e3, 30e3, 601)
    fraction = sun_visible_fraction(along_the_shadow_edge(heights), SUN)
    assert fraction[0] == 0.0
    assert fraction[-1] == 1.0
    assert np.all(np.diff(fraction) >= 0)
    partial = (fraction > 0) & (fraction < 1)
    # the penumbra is as wide as the Sun's disc seen over the distance from the limb
    width = np.ptp(heights[partial])
    assert width == pytest.approx(2e6 * 2 * SUN_RADIUS_M / AU_M, rel=0.02)
    # half the disc is hidden where the limb passes its centre
    assert heights[np.argmin(abs(fraction - 0.5))] == pytest.approx(EARTH_RADIUS_M, abs=200)


def test_day_side_is_lit_and_deep_shadow_is_dark() -> None:
    assert sun_visible_fraction([7e6, 0, 0], SUN) == 1.0
    assert sun_visible_fraction([0, 7e6, 0], SUN) == 1.0
    assert sun_visible_fraction([-7e6, 0, 0], SUN) == 0.0


def test_far_behind_the_umbra_the_eclipse_is_annular() -> None:
    distance = 3e9
    fraction = sun_visible_fraction([-distance, 0, 0], SUN)
    ratio = (EARTH_RADIUS_M / distance) / (SUN_RADIUS_M / (AU_M + distance))
    assert fraction == pytest.approx(1 - ratio**2, abs=1e-4)


def test_area_agrees_with_counting_points_of_the_disc() -> None:
    """The same overlap by casting rays from the spacecraft to points of the Sun's disc."""
    r = along_the_shadow_edge(np.array([EARTH_RADIUS_M - 4e3]))[0]
    rng = np.random.default_rng(1)
    radius, angle = SUN_RADIUS_M * np.sqrt(rng.random(200_000)), 2 * np.pi * rng.random(200_000)
    points = SUN + np.stack([np.zeros_like(radius), radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    d = points - r
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    miss = np.linalg.norm(r - (d @ r)[:, None] * d, axis=-1) > EARTH_RADIUS_M
    assert sun_visible_fraction(r, SUN) == pytest.approx(np.mean(miss), abs=0.004)
