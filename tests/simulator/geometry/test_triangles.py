"""Distances of points from triangles, and what closed shells enclose."""

import numpy as np
import pytest
import trimesh

from flyaround.simulator.geometry.triangles import distance_to_triangles, encloses_origin


def test_distances_agree_with_trimesh():
    rng = np.random.default_rng(3)
    points, corners = rng.normal(size=(500, 3)), rng.normal(size=(500, 3, 3))
    closest = trimesh.triangles.closest_point(corners, points)
    expected = np.linalg.norm(closest - points, axis=1)
    assert distance_to_triangles(points, corners) == pytest.approx(expected, abs=1e-12)


def test_a_triangle_without_area_is_as_far_as_its_sides():
    sliver = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    assert distance_to_triangles(np.array([[1.5, 3.0, 4.0]]), sliver) == pytest.approx([5.0])


@pytest.mark.parametrize(("shift", "inside"), [(0.0, True), (0.49, True), (0.51, False), (5.0, False)])
def test_a_box_encloses_the_origin(shift, inside):
    box = trimesh.creation.box(extents=(1, 1, 1)).apply_translation((shift, 0.1, -0.2))
    assert encloses_origin(np.asarray(box.triangles)) is inside
