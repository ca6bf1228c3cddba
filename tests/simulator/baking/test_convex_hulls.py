"""Convex hulls of a craft's parts: what lies inside of another one's need not be looked at."""

import itertools

import numpy as np

from flyaround.simulator.baking.baked_mesh import outer_hulls


def _box(low, high):
    return np.array(list(itertools.product(*zip(low, high, strict=True))), float)


def test_hulls_inside_of_others_are_left_out():
    outer, inner, across = (
        _box((0, 0, 0), (4, 3, 2)),
        _box((1, 0, 1), (2, 2, 2)),
        _box((3, 1, 1), (5, 2, 1.5)),
    )
    flat = np.array([[1.0, 1, 1], [2, 1, 1], [2, 2, 1], [1, 2, 1]])
    hulls = outer_hulls([inner, outer, flat, across, outer])
    assert [len(hull) for hull in hulls] == [8, 8]
    np.testing.assert_array_equal(np.sort(hulls[0], axis=0), np.sort(outer, axis=0))
    np.testing.assert_array_equal(np.sort(hulls[1], axis=0), np.sort(across, axis=0))


def test_a_box_about_a_hull_does_not_hide_what_stands_out_of_its_slopes():
    pyramid = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 4]])
    beside = _box((0.2, 0.2, 3.0), (0.6, 0.6, 3.4))
    assert len(outer_hulls([pyramid, beside])) == 2
    assert len(outer_hulls([pyramid, _box((1.9, 1.9, 1), (2.1, 2.1, 2))])) == 1
