"""Pixels of masks against NumPy's own."""

import numpy as np
import pytest

from flyaround.simulator.dataset.check import imported, verify
from flyaround.simulator.dataset.check.mask_statistics import box_with_opencv, is_binary, nonzero_pixels
from flyaround.simulator.labels import boxes
from flyaround.simulator.labels.boxes import mask_box


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


def test_the_box_of_a_mask_is_that_of_the_labels_but_not_made_by_their_code(monkeypatch):
    rng = np.random.default_rng(2)
    masks = [np.zeros((5, 9), np.uint8), np.full((5, 9), 255, np.uint8)]
    masks += [(rng.random((30, 40)) < share).astype(np.uint16) * 255 for share in (0.001, 0.003, 0.2)]
    boxes_by_labels = [mask_box(mask) for mask in masks]
    monkeypatch.setattr(boxes, "craft_window", lambda _mask: (slice(1, 2), slice(1, 2)))
    assert [box_with_opencv(mask) for mask in masks] == boxes_by_labels
    monkeypatch.undo()
    for module in (verify, imported):
        assert not hasattr(module, "mask_box")
