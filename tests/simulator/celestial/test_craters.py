"""Craters of the Moon: fresh shapes as measured, and how they wear."""

import numpy as np
import pytest

from flyaround.simulator.celestial.craters import eroded_profiles, fresh_profile, make_craters

NODES = np.arange(101) * 0.04


@pytest.mark.parametrize(("diameter_km", "depth_km"), [(1.0, 0.196), (10.0, 2.0), (40.0, 3.17), (70.0, 3.75)])
def test_a_fresh_crater_is_as_deep_as_measured(diameter_km, depth_km):
    r = np.append(np.linspace(0.2, 0.99999, 200), np.linspace(1, 3, 50))
    profile = fresh_profile(r, diameter_km) * diameter_km / 2
    assert profile.max() - profile.min() == pytest.approx(depth_km, rel=0.05)  # Pike (1977), rim to floor
    assert profile[200:].argmax() == 0


def test_wear_makes_craters_shallow_and_round_and_loses_no_ground():
    worn = eroded_profiles(1.0)
    depth = worn.max(axis=1) - worn[:, 0]
    assert np.all(np.diff(depth) < 0)
    # Fassett & Thomson (2014): at 5.5 m2 a million years 1 km keeps 0.52 of its depth after 3 Ga, 300 m 0.07
    after = (
        np.interp([5.5 * 3000 / 500**2, 5.5 * 3000 / 150**2], np.linspace(0, 0.7, len(worn)), depth)
        / depth[0]
    )
    assert after == pytest.approx([0.52, 0.07], abs=0.1)
    steepest = np.abs(np.diff(worn, axis=1)).max(axis=1)
    assert steepest[8] < 0.4 * steepest[0]
    # ground is moved, not lost, until it leaves the profile
    ground = 2 * np.pi * (worn[:6, :70] * NODES[:70]).sum(axis=1) * 0.04
    assert np.ptp(ground) < 0.05 * np.abs(2 * np.pi * (np.minimum(worn[0], 0) * NODES).sum() * 0.04)


def test_most_craters_are_old_and_few_are_bright():
    tile = make_craters(45.0, 63.0 / 1024).astype(float) / 255
    slope = np.hypot(*np.moveaxis((tile[..., :2] - 0.5) * 1.8, 2, 0))
    assert np.mean(slope > 0.3) < 0.05  # walls of fresh craters
    assert 0.05 < np.sqrt(np.mean(slope**2)) < 0.2
    assert tile[..., 2].mean() == pytest.approx(0.5, abs=0.004)  # the map keeps its albedo
    assert np.mean(tile[..., 2] > 0.65) < 0.06
