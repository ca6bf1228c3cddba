"""The valleys of `high`: a land that rivers cut drains downhill, all of it, and tiles."""

import numpy as np
import pytest

from flyaround.simulator.celestial.earth_maps import TERRAIN_SLOPE_MAX, terrain_texture
from tools.cook import terrain as valleys


@pytest.fixture(scope="module")
def land():
    rng = np.random.default_rng(3)
    outlets = np.zeros((48, 48), bool)
    outlets[20:22, 5:40] = True
    hardness = np.exp(0.4 * rng.standard_normal(outlets.shape))
    return outlets, hardness, *valleys.drainage(outlets, hardness, 3)


def test_the_texture_is_even_and_tiles():
    tile = terrain_texture().astype(float) / 255
    assert tile.shape == (valleys.SIZE, valleys.SIZE, 4)
    slopes = (tile[..., :2] - 0.5) * 2 * TERRAIN_SLOPE_MAX
    assert np.abs(slopes.mean((0, 1))).max() < 0.01  # up as much as down: it comes back to its height
    assert 0.2 < np.sqrt(np.mean(np.sum(slopes**2, -1))) < 0.25
    assert tile[..., 2].mean() == pytest.approx(0.5, abs=0.02)
    for channel in range(4):
        image = tile[..., channel]
        inside = np.abs(np.diff(image, axis=0)).mean()
        assert np.abs(image[0] - image[-1]).mean() < 1.2 * inside
