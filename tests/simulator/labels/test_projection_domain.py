"""The domain that docs/labels.md says of projections: OpenCV's where the lens is known, outside of it outside."""

import cv2
import numpy as np
import pytest

import flyaround as fa
from flyaround.simulator.dataset.check.geometry import in_lens

CAMERAS = ("speed", "speedplus", "fisheye-140")


def both(name):
    """Points around a camera's axis, their pixels, and OpenCV's."""
    camera = fa.load_camera(name)
    rng = np.random.default_rng(3)
    wide = rng.uniform(-4, 4, (4000, 2)) * rng.uniform(0, 1, (4000, 1)) ** 2
    points = np.column_stack([wide, np.ones(len(wide))]) * rng.uniform(2, 10, (len(wide), 1))
    lens = np.array(camera.distortion.coefficients or [0.0] * 5)
    none = np.zeros(3)
    if camera.distortion.model == "kannala_brandt":
        theirs = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), none, none, camera.K, lens)[0]
    else:
        theirs = cv2.projectPoints(points, none, none, camera.K, lens)[0]
    return camera, points, camera.project(points), theirs.reshape(-1, 2)


@pytest.mark.parametrize("name", CAMERAS)
def test_pixels_are_opencvs_on_the_image_and_a_little_beyond(name):
    camera, points, ours, theirs = both(name)
    known = in_lens(camera, points)
    on_image = camera.contains(ours)
    assert known[on_image].all()
    assert np.count_nonzero(known & ~on_image) > 20
    assert np.abs(ours - theirs)[known] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_point_beyond_the_lens_stays_outside_the_image(name):
    camera, points, ours, theirs = both(name)
    beyond = ~in_lens(camera, points)
    assert not camera.contains(ours[beyond]).any()
    if name == "speedplus":  # OpenCV's polynomial turns back: no label may be taken from there
        assert np.abs(ours - theirs)[beyond].max() > 1
