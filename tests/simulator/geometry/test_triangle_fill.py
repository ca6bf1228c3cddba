"""Silhouettes filled by OpenCV: of triangles that reach far outside the image too, as close craft have them."""

import numpy as np
import pytest

from flyaround.simulator.geometry.triangle_fill import fill_triangles, polygon_within

WIDTH, HEIGHT = 160, 120


def _within(corners):
    """(H, W) by how many pixels each centre lies within the nearest side of a triangle (3, 2); negative outside."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    sides = np.roll(corners, -1, axis=0) - corners
    turn = np.sign(sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0])
    inside = [
        turn * (w[0] * (y - a[1]) - w[1] * (x - a[0])) / np.hypot(*w)
        for a, w in zip(corners, sides, strict=True)
    ]
    return np.min(inside, axis=0)


@pytest.mark.parametrize("far", [1e2, 1e4, 1e6, 3e7])
@pytest.mark.parametrize("turn_deg", [0.0, 63.0, 117.0, 255.0])
def test_a_triangle_with_a_corner_far_outside_is_filled_where_its_sides_say(far, turn_deg):
    """A corner 1 mm before the camera is a million pixels away: the sides on the image still lie where they do."""
    turn = np.radians(turn_deg)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    wedge = np.array([[-31.0, 9.0], [-27.0, -12.0], [far, 0.37 * far]])
    corners = wedge @ R.T + np.array([WIDTH, HEIGHT]) / 2
    filled = np.zeros((HEIGHT, WIDTH), np.uint8)
    fill_triangles(filled, corners[None])
    within = _within(corners)
    assert np.count_nonzero(within > 0) > 300
    # OpenCV fills what a side touches
    assert np.all(filled[within > 0.1] == 255)
    assert not filled[within < -1.1].any()


def test_a_polygon_is_cut_to_a_rectangle():
    square = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]])
    assert np.array_equal(polygon_within(square, -1, np.array([9, 9])), square)
    cut = polygon_within(square, 2, np.array([5, 20]))
    assert (cut.min(axis=0).tolist(), cut.max(axis=0).tolist()) == ([2, 2], [5, 8])
    assert len(polygon_within(square + 30, 2, np.array([5, 20]))) == 0
