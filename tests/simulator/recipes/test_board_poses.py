"""Poses of calibration boards: rotations between directions."""

import numpy as np
import pytest

from flyaround.simulator.recipes.board_poses import _rotation_between

DIRECTIONS = [
    np.array([0.0, 0.0, 1.0]),
    np.array([1.0, 0.0, 0.0]),
    np.array([0.0, -1.0, 0.0]),
    np.array([3.0, 3.0, 3.0]) / np.sqrt(27),
    np.array([0.8, 0.0, -0.6]),
]


@pytest.mark.parametrize("a", DIRECTIONS)
@pytest.mark.parametrize("b", [*DIRECTIONS, *(-d for d in DIRECTIONS)])
def test_the_smallest_rotation_carries_one_direction_to_another_and_to_the_opposite_one(a, b):
    R = _rotation_between(a, b)
    assert pytest.approx(b, abs=1e-12) == R @ a
    assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1)
    # no rotation is smaller than the angle between them
    assert (np.trace(R) - 1) / 2 == pytest.approx(a @ b, abs=1e-12)
