"""Boxes and feasibility from made-up buffers."""

import numpy as np

from simulator.labels.feasible import visible_samples
from simulator.labels.frame import mask_box


def test_one_pixel_mask_has_the_box_of_the_contract():
    mask = np.zeros((10, 12), np.uint8)
    mask[4, 3] = 255
    assert mask_box(mask) == (2.5, 3.5, 3.5, 4.5)


def test_empty_mask_has_no_box():
    assert mask_box(np.zeros((5, 5), np.uint8)) is None


def test_box_touches_the_image_edges():
    assert mask_box(np.full((6, 8), 255, np.uint8)) == (-0.5, -0.5, 7.5, 5.5)


def test_samples_behind_the_surface_are_hidden_and_outlines_are_seen():
    depth = np.full((20, 20), np.nan, np.float32)
    depth[5:15, 5:15] = 4.0
    pixels = np.array([[10.0, 10.0], [10.0, 10.0], [5.0, 10.0], [1.0, 1.0], [25.0, 3.0]])
    seen = visible_samples(pixels, np.array([4.0, 4.5, 4.0, 6.0, 4.0]), depth)
    assert seen.tolist() == [True, False, True, True, False]
