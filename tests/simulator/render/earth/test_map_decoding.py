"""Maps are decoded into one piece of memory and packed strip by strip, as they would be in one go."""

import cv2
import numpy as np
import pytest

from simulator.errors import UserError
from simulator.render.earth import maps
from simulator.render.earth.ocean_colour import MASK


def test_strips_are_those_of_the_whole_map():
    beside = np.random.default_rng(41).random((maps.HEIGHT // 4, maps.WIDTH // 4), np.float32)
    root = cv2.convertScaleAbs(cv2.sqrt(beside), alpha=255.0)
    whole = cv2.resize(root, (maps.WIDTH, maps.HEIGHT), interpolation=cv2.INTER_LINEAR)
    for rows in (maps._STRIPS[0], maps._STRIPS[20], maps._STRIPS[-1]):
        np.testing.assert_array_equal(maps._enlarged_root(beside, rows), whole[rows])


def test_the_strips_hold_each_row_once():
    assert [row for rows in maps._STRIPS for row in range(rows.start, rows.stop)] == list(range(maps.HEIGHT))


def test_an_opencv_that_cannot_decode_into_given_memory_gives_the_same(monkeypatch):
    here = maps.decode_file(MASK, cv2.IMREAD_GRAYSCALE)

    def refuse(*_):
        raise cv2.error("no such overload")

    monkeypatch.setattr(cv2, "imread", refuse)
    np.testing.assert_array_equal(maps.decode_file(MASK, cv2.IMREAD_GRAYSCALE), here)


def test_a_missing_map_is_the_users_to_mend():
    with pytest.raises(UserError, match="missing; install Flyaround again"):
        maps.decode_file("day_of_nowhere.jpg", cv2.IMREAD_COLOR)


def test_a_strip_ends_where_ice_is_looked_for_no_more():
    # otherwise the height of the strips would say where
    edges = [maps.HEIGHT * (0.5 + sign * maps._ICE_LATITUDE_DEG / 180) for sign in (-1, 1)]
    assert {rows.start for rows in maps._STRIPS}.issuperset(edges)
