"""Boxes from made-up masks."""

import numpy as np

from flyaround.simulator.labels.boxes import mask_box


def test_one_pixel_mask_has_the_box_of_the_contract():
    mask = np.zeros((10, 12), np.uint8)
    mask[4, 3] = 255
    assert mask_box(mask) == (2.5, 3.5, 3.5, 4.5)


def test_empty_mask_has_no_box():
    assert mask_box(np.zeros((5, 5), np.uint8)) is None


def test_box_touches_the_image_edges():
    assert mask_box(np.full((6, 8), 255, np.uint8)) == (-0.5, -0.5, 7.5, 5.5)
