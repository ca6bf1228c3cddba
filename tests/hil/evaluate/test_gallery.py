"""Tiles of the failures' gallery: what is drawn where."""

from types import SimpleNamespace

import numpy as np
import pytest
from drawn_craft import CAMERA, Craft

from flyaround.hil.evaluate.evaluation_page import _rotation_error_deg
from flyaround.hil.evaluate.failure_tiles import ESTIMATE_COLOUR, HEIGHT, OUTSIDE_LEVEL, WIDTH, failure_tile

Q = (1.0, 0.0, 0.0, 0.0)


def tile(estimated_m, box):
    image = np.full((CAMERA.height_px, CAMERA.width_px), 20, np.uint8)
    return failure_tile(image, box, Craft().model(), CAMERA, (Q, (0.0, 0.0, 4.0)), (Q, estimated_m))


def test_a_pose_without_rotation_error_is_not_the_worst():
    frames = [SimpleNamespace(record=SimpleNamespace(E_R_deg=e)) for e in (0.0, 90.0, None, 5.0)]
    worst = sorted(frames, key=_rotation_error_deg, reverse=True)
    assert [f.record.E_R_deg for f in worst] == [None, 90.0, 5.0, 0.0]


@pytest.mark.parametrize(("x_m", "side"), [(3.0, 1), (-3.0, -1)])
def test_an_arrow_shows_where_an_estimate_beyond_the_tile_lies(x_m, side):
    x, y = 0.5 * CAMERA.width_px, 0.5 * CAMERA.height_px
    orange = np.all(tile((x_m, 0.0, 4.0), (x - 20, y - 15, x + 20, y + 15)) == ESTIMATE_COLOUR, axis=-1)
    _, columns = np.nonzero(orange)
    assert len(columns) > 50
    assert np.all(side * (columns - WIDTH / 2) > 0.6 * WIDTH / 2)


def test_beyond_the_picture_is_grey_and_no_space():
    # the target's box round the picture's upper left corner
    corner = tile((0.0, 0.0, 4.0), (-30.0, -20.0, 30.0, 20.0))
    assert np.all(corner[: HEIGHT // 2 - 20, : WIDTH // 2 - 20] == OUTSIDE_LEVEL)
