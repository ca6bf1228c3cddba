"""The domain that docs/labels.md says of projections: OpenCV's where the lens is known, outside of it outside."""

import cv2
import numpy as np
import pytest

import flyaround as fa
from flyaround.simulator.dataset.check.geometry import in_lens, project_with_opencv
from flyaround.simulator.world.frames.pose import Pose

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


@pytest.mark.parametrize("near", [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.6, -0.8, 0.0)])
@pytest.mark.parametrize("off_rad", [0.0, 1e-9, 1e-7, 3e-6, 1e-5, 1e-3])
def test_the_check_projects_exactly_near_no_turn_and_half_a_turn(near, off_rad):
    """A board seen face-on has such a pose."""
    camera, q = fa.load_camera("speed"), np.array(near) + off_rad * np.array([0.3, -0.2, 0.5, 0.7])
    pose = Pose.from_arrays("camera", "target", tuple(q / np.linalg.norm(q)), np.array([0.0, 0.1, 2.0]))
    points = np.random.default_rng(4).uniform(-0.3, 0.3, (50, 3))
    theirs = project_with_opencv(camera, points, pose.q_wxyz, np.asarray(pose.t_m))
    np.testing.assert_allclose(theirs, camera.project(pose.apply(points)), rtol=0, atol=1e-9)
