"""The proof of labels by rays: what a raster's rounding may show is no fault, what it may not is one."""

import numpy as np
import pytest

from tools.validation.datasets.report import prove
from tools.validation.datasets.rounded_raster import shown_parts


def _sheet(corners_px, z_m):
    """Two triangles of a sheet of four corners, facing the camera as rows go down: corners, depths."""
    a, b, c, d = np.asarray(corners_px, float)
    depth = np.broadcast_to(np.asarray(z_m, float), 4)
    faces = [(0, 2, 1), (0, 3, 2)]
    return np.array([[(a, b, c, d)[i] for i in f] for f in faces]), np.array([depth[list(f)] for f in faces])


def _shown(*sheets, lens=False):
    corners, depth = (np.concatenate(x) for x in zip(*sheets, strict=True))
    return shown_parts(corners, depth, np.repeat(np.arange(1, len(sheets) + 1), 2), 2e-3, lens=lens)


BOARD = _sheet([(-9, -7), (8, -9), (9, 8), (-8, 9)], 20.0)


def _wall(beside_px, width_px=0.001):
    """A wall before the board, seen edge-on: 9 px long, thinner than a step of the raster."""
    way = np.array([0.8, 0.6])
    across = np.array([-0.6, 0.8])
    middle = beside_px * across
    ends = [
        middle + s * 4.5 * way + w * width_px / 2 * across for s, w in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return _sheet(ends, [19.9, 19.7, 19.7, 19.9])


def test_a_face_seen_edge_on_may_be_shown_where_a_ray_just_misses_it():
    """From 0.31 to 0.64 steps beside the centre, and so from the centre to one step beside it."""
    wall = _sheet([(0.0012, -5), (0.0025, -5), (0.0025, 5), (0.0012, 5)], 19.9)
    assert 2 in _shown(BOARD, wall)


@pytest.mark.parametrize("beside_px", [0.02, -0.02, 0.5])
def test_a_face_seen_edge_on_is_not_shown_farther_from_the_centre_than_a_step(beside_px):
    assert _shown(BOARD, _wall(beside_px)) == {1}


@pytest.mark.parametrize(("beside_px", "shown"), [(0.01, {1, 2}), (0.06, {1})])
def test_through_a_lens_an_edge_may_lie_as_far_beside_as_the_picture_follows_it(beside_px, shown):
    beside = _sheet([(beside_px, -5), (5, -5), (5, 5), (beside_px, 5)], 19.0)
    assert _shown(BOARD, beside, lens=True) == shown
    assert _shown(BOARD, beside) == {1}


def test_a_sheet_has_no_crack_where_its_triangles_meet_at_the_centre():
    """The diagonal passes through the centre; a wide sheet behind must not show there."""
    through = _sheet([(-5, -5), (5, -5), (5, 5), (-5, 5)], 10.0)
    assert _shown(through, BOARD) == {1}
    turned = _sheet([(-5, 3), (-3, -5), (5, -3), (3, 5)], 10.0)
    assert _shown(turned, BOARD) == {1}


def test_an_outline_within_a_step_of_the_centre_may_fall_either_way():
    beside = _sheet([(-5, -5), (0.001, -5), (0.001, 5), (-5, 5)], 10.0)
    away = _sheet([(-5, -5), (0.02, -5), (0.02, 5), (-5, 5)], 10.0)
    assert _shown(beside) <= {0, 1}
    assert 0 in _shown(beside)
    assert _shown(away) == {1}


def test_what_lies_on_another_may_be_shown_and_what_lies_behind_may_not():
    decal = _sheet([(-5, -5), (5, -5), (5, 5), (-5, 5)], 20.001)
    behind = _sheet([(-5, -5), (5, -5), (5, 5), (-5, 5)], 20.01)
    assert _shown(BOARD, decal) == {1, 2}
    assert _shown(BOARD, behind) == {1}


@pytest.mark.parametrize(("gap_m", "shown"), [(0.03, {1, 2}), (0.5, {1})])
def test_a_steep_face_hides_what_lies_behind_it_by_more_than_its_depth_is_known(gap_m, shown):
    """Three steps wide, 0.084 m deep: its depth changes by 0.055 m over the two steps that it may be off."""
    steep = _sheet([(-0.006, -5), (0.006, -5), (0.006, 5), (-0.006, 5)], [20.0, 20.084, 20.084, 20.0])
    behind = _sheet([(-5, -5), (5, -5), (5, 5), (-5, 5)], 20.042 + gap_m)
    assert _shown(steep, behind) == shown


@pytest.mark.parametrize(("gap_m", "shown"), [(0.008, {1, 2}), (0.02, {1}), (0.5, {1})])
def test_a_face_four_pixels_wide_is_known_to_two_steps_of_its_slope(gap_m, shown):
    """Its depth changes by a metre a pixel, by 0.008 m over two steps; 0.002 m more are a decal's."""
    sloping = _sheet([(-2, -5), (2, -5), (2, 5), (-2, 5)], [18.0, 22.0, 22.0, 18.0])
    # 1/z is linear on the image: what is seen at the centre is nearer than the corners' mean
    behind = _sheet([(-5, -5), (5, -5), (5, 5), (-5, 5)], 19.8 + gap_m)
    assert _shown(sloping, behind) == shown


@pytest.mark.gl
def test_faces_thinner_than_a_step_of_the_raster_do_not_fall_behind_what_they_hide():
    """One pixel of 10,062 images: a Soyuz 33 m away, of whose blankets a fold is a tenth of a pixel wide."""
    found = next(iter(prove("urso-like", 68, 2813, 384, first=67)))
    assert found["faults"] == []
    assert (found["mask"], found["parts"], found["twice"]) == (0, 0, 0)
