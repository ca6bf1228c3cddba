"""What a raster's rounding may show at a pixel's centre: cracks, slivers, curved surfaces thinner than the rounding."""

import numpy as np
import pytest

from flyaround.simulator.dataset.check.raster_tolerance import triangles_near

TO_CAMERA = np.tile([0.0, 0.0, -1.0], (3, 1))


def _square(x0, x1, z_m):
    """Two triangles over x0 < x < x1, -1 < y < 1 at one depth: corners, inverse depths, normals."""
    a, b, c, d = [x0, -1], [x1, -1], [x1, 1], [x0, 1]
    corners = np.array([[a, b, c], [a, c, d]], float)
    return corners, np.full((2, 3), 1 / z_m), np.stack([TO_CAMERA, TO_CAMERA])


def _ask(*squares):
    corners, inverse, normals = (np.concatenate(x) for x in zip(*squares, strict=True))
    parts = np.repeat(np.arange(1, len(squares) + 1), 2)
    return triangles_near(corners, inverse, normals, parts, 0.03)


@pytest.mark.parametrize(("border_px", "is_sure"), [(0.0, False), (0.005, False), (0.02, True)])
def test_a_centre_on_a_crack_between_two_sheets_may_be_missed(border_px, is_sure):
    found = _ask(_square(-1.3, border_px, 5.0), _square(border_px, 1.7, 5.0))
    assert found.is_sure == is_sure


def test_what_lies_behind_a_sure_surface_is_not_shown_and_what_borders_on_the_centre_is():
    found = _ask(_square(-1.3, 1.7, 5.0), _square(0.01, 1.7, 4.0), _square(-1.3, 1.7, 9.0))
    assert set(found.parts.tolist()) == {1, 2}
    assert (found.nearest_m.min(), found.farthest_m.max()) == (pytest.approx(4.0), pytest.approx(5.0))
    assert set(_ask(_square(-1.3, 1.7, 5.0), _square(0.05, 1.7, 4.0)).parts.tolist()) == {1}


def test_depth_of_a_steep_surface_is_known_to_the_doubt():
    """1/z falls by 0.01 a pixel: 0.03 px about the centre it is 0.1 +- 0.0003."""
    corners, _, normals = _square(-1.3, 1.7, 1.0)
    found = triangles_near(corners, 0.1 - 0.01 * corners[..., 0], normals, np.array([1, 1]), 0.03)
    assert 1 / found.nearest_m.min() == pytest.approx(0.1003)
    assert 1 / found.farthest_m.max() == pytest.approx(0.0997)


def test_a_rod_thinner_than_the_rounding_shows_any_normal_of_its_facets_there_and_no_other():
    """Two facets 0.003 px wide of a rod along y, their corners' normals at -20, 0 and 20 degrees about it."""
    x = 0.003 * np.array([-1, 0, 1])
    n = np.array([[np.sin(a), 0, -np.cos(a)] for a in np.radians([-20, 0, 20])])
    corners, normals = [], []
    for k in (0, 1):
        quad = [[x[k], -1], [x[k + 1], -1], [x[k + 1], 1], [x[k], 1]]
        of = [n[k], n[k + 1], n[k + 1], n[k]]
        for i in ((0, 1, 2), (0, 2, 3)):
            corners.append([quad[j] for j in i])
            normals.append([of[j] for j in i])
    found = triangles_near(np.array(corners), np.full((4, 3), 0.2), np.array(normals), np.ones(4, int), 0.03)
    ray = np.array([0.0, 0.0, 1.0])

    def shows(about_y_deg, about_x_deg=0.0):
        a, b = np.radians([about_y_deg, about_x_deg])
        return found.has_normal(
            np.array([np.sin(a) * np.cos(b), np.sin(b), -np.cos(a) * np.cos(b)]), ray, 0.05
        )

    # a corner moved by the rounding shows facets as much as 2.6 of their widths beyond their borders
    assert all(shows(a) for a in (-45, -13, 0, 7, 19, 45))
    assert not any(shows(a) for a in (-85, 85))
    assert not any(shows(a, tilt) for a in (-10, 0, 10) for tilt in (-6, 6))


def test_a_wide_facet_shows_its_own_normal_alone():
    found = _ask(_square(-1.3, 1.7, 5.0))
    ray = np.array([0.0, 0.0, 1.0])
    assert found.has_normal(np.array([0.0, 0.02, -1.0]), ray, 0.05)
    assert not found.has_normal(np.array([0.0, 0.08, -1.0]), ray, 0.05)


def test_a_broad_facet_shows_no_normal_beyond_those_of_its_corners():
    """Three pixels across, its corners' normals at -10 and 10 degrees: the rounding adds a degree at most."""
    corners, inverse, _ = _square(-1.3, 1.7, 5.0)
    turn = np.radians(np.where(corners[..., 0] < 0, -10.0, 10.0))
    normals = np.stack([np.sin(turn), 0 * turn, -np.cos(turn)], axis=-1)
    found = triangles_near(corners, inverse, normals, np.array([1, 1]), 0.03)

    def shows(about_y_deg):
        a = np.radians(about_y_deg)
        return found.has_normal(np.array([np.sin(a), 0.0, -np.cos(a)]), np.array([0.0, 0.0, 1.0]), 0.002)

    assert all(shows(a) for a in (-9, -3, 0, 5, 9))
    assert not any(shows(a) for a in (-14, -12, 12, 14, 40))
