"""Pixels of masks against NumPy's own."""

import numpy as np
import pytest

from flyaround.simulator.dataset.check.mask_statistics import is_binary, nonzero_pixels


@pytest.mark.parametrize("shape", [(7, 5), (1, 9), (0, 4)])
def test_pixels_and_their_order_are_numpys(shape):
    rng = np.random.default_rng(3)
    mask = rng.choice([0, 255], shape).astype(np.uint8)
    assert np.array_equal(nonzero_pixels(mask), np.argwhere(mask)[:, ::-1])
    assert np.array_equal(nonzero_pixels(mask[:, ::2]), np.argwhere(mask[:, ::2])[:, ::-1])
    assert nonzero_pixels(np.zeros(shape, np.uint8)).shape == (0, 2)
    assert is_binary(mask)


@pytest.mark.parametrize("value", [1, 2, 128, 254])
def test_any_other_value_is_noticed(value):
    mask = np.zeros((4, 6), np.uint8)
    mask[1:3] = 255
    assert is_binary(mask)
    mask[3, 5] = value
    assert not is_binary(mask)


def test_a_mask_of_wider_numbers_is_none():
    assert not is_binary(np.full((2, 2), 255, np.uint16))
    assert not is_binary(np.full((2, 2), 65535, np.uint16))
