"""Maps are packed strip by strip, as they would be in one go."""

import cv2
import numpy as np
import pytest

from flyaround.simulator.celestial import earth_maps as maps
from flyaround.simulator.errors import UserError


def test_strips_are_those_of_the_whole_map():
    beside = np.random.default_rng(41).random((maps.HEIGHT // 4, maps.WIDTH // 4), np.float32)
    root = cv2.convertScaleAbs(cv2.sqrt(beside), alpha=255.0)
    whole = cv2.resize(root, (maps.WIDTH, maps.HEIGHT), interpolation=cv2.INTER_LINEAR)
    for rows in (maps._STRIPS[0], maps._STRIPS[20], maps._STRIPS[-1]):
        np.testing.assert_array_equal(maps._enlarged_root(beside, rows), whole[rows])


def test_a_missing_map_is_the_users_to_mend():
    with pytest.raises(UserError, match="missing; install Flyaround again"):
        maps.decode_file("day_of_nowhere.jpg", cv2.IMREAD_COLOR)
