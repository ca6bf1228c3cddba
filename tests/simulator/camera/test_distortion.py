"""Lens distortion against OpenCV's projection, its inverse, and refusal of lenses that fold back."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Camera, camera_problem
from flyaround.simulator.camera.lens.distortion import Distortion, distort

PINHOLE = Camera(width_px=320, height_px=240, fx_px=300.0, fy_px=310.0, cx_px=155.0, cy_px=122.0)
LENSES = {
    "none": Distortion(),
    "brown4": Distortion("brown_conrady", (-0.22, 0.09, 0.001, -0.002)),
    "brown5": Distortion("brown_conrady", (0.12, 0.05, -0.001, 0.003, 0.02)),
    "brown8": Distortion("brown_conrady", (0.3, 0.1, 0.001, 0.0005, 0.02, 0.5, 0.15, 0.01)),
    "fisheye": Distortion("kannala_brandt", (0.05, -0.02, 0.004, -0.001)),
}


def camera_with(lens, focal=300.0):
    return replace(PINHOLE, distortion=LENSES[lens], fx_px=focal, fy_px=focal * 1.03)


def opencv(camera, points):
    if camera.distortion.model == "kannala_brandt":
        d = np.array(camera.distortion.coefficients)
        return cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), camera.K, d)[0][:, 0]
    return cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.K, np.array(camera.distortion.coefficients)
    )[0][:, 0]


@pytest.mark.parametrize("lens", LENSES)
def test_projection_matches_opencv(lens):
    camera = camera_with(lens)
    rng = np.random.default_rng(0)
    pixels = rng.uniform([0, 0], [319, 239], (500, 2))
    points = camera.rays(pixels) * rng.uniform(1, 50, (500, 1))
    assert np.abs(camera.project(points) - pixels).max() < 1e-9
    assert np.abs(opencv(camera, points) - pixels).max() < 1e-8


def test_fisheye_sees_past_sixty_degrees():
    camera = camera_with("fisheye", focal=140.0)
    assert np.rad2deg(camera.half_angle_rad()) > 65
    pixels = np.stack(np.meshgrid(np.arange(0, 320, 7.0), np.arange(0, 240, 7.0)), -1).reshape(-1, 2)
    assert np.abs(camera.project(camera.rays(pixels)) - pixels).max() < 1e-9


@pytest.mark.parametrize("lens", LENSES)
def test_solid_angles_of_the_pixels_add_up_to_the_field_of_view(lens):
    camera = camera_with(lens)
    x, y = np.meshgrid(np.arange(320.0), np.arange(240.0))
    total = camera.pixel_solid_angle_sr(np.stack([x, y], -1)).sum()
    # the same by Girard's theorem on the polygon of the border's rays
    border = camera.border(800)
    n = 800
    loop = np.concatenate([border[:n], border[3 * n :], border[n : 2 * n][::-1], border[2 * n : 3 * n][::-1]])
    r = camera.rays(loop)
    a, b, c = np.array([0, 0, 1.0]), r, np.roll(r, -1, axis=0)
    triple = np.abs((np.cross(b, c) * a).sum(-1))
    excess = 2 * np.arctan2(triple, 1 + b @ a + (b * c).sum(-1) + c @ a)
    assert total == pytest.approx(excess.sum(), rel=2e-5)


def test_what_is_outside_the_field_stays_outside():
    # k1 alone: the bare polynomial brings 60 degrees back to the middle of the image
    camera = replace(PINHOLE, distortion=Distortion("brown_conrady", (-0.25, 0.0, 0.0, 0.0)))
    angle = np.deg2rad(np.linspace(35, 89.9, 200))
    points = np.stack([np.sin(angle), np.zeros(200), np.cos(angle)], -1)
    pixels = camera.project(points)
    assert not camera.contains(pixels).any()
    assert np.all(np.diff(pixels[:, 0]) > 0)
    folded = opencv(camera, points)
    assert camera.contains(folded).any()


@pytest.mark.parametrize(
    ("distortion", "says"),
    [
        (Distortion("brown_conrady", (-1.5, 0.0, 0.0, 0.0)), "folds back inside the image"),
        (Distortion("brown_conrady", (0.0, 0.0, 0.9, 0.9)), "tangential"),
        (Distortion("brown_conrady", (-2.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0)), "folds back"),
        (Distortion("kannala_brandt", (-1.5, 0.0, 0.0, 0.0)), "folds back"),
    ],
)
def test_invalid_lens_is_refused(distortion, says):
    problem = camera_problem(replace(PINHOLE, distortion=distortion))
    assert problem is not None
    assert says in problem


@pytest.mark.parametrize(
    ("model", "coefficients", "says"),
    [
        ("brown_conrady", (0.1, 0.2), "has 2 numbers, model brown_conrady takes 4 or 5 or 8"),
        ("none", (0.1,), "has 1 numbers, model none takes 0"),
        ("kannala_brandt", (0.1, float("nan"), 0.0, 0.0), "finite"),
        (
            "brown-conrady",
            (0.1, 0.2, 0.0, 0.0),
            "'brown-conrady', allowed: none, brown_conrady, kannala_brandt",
        ),
    ],
)
def test_coefficients_that_are_of_no_model_are_refused(model, coefficients, says):
    with pytest.raises(ValueError, match=says):
        Distortion(model, coefficients)


@pytest.mark.parametrize("lens", LENSES)
def test_the_inverse_is_as_exact_as_it_says(lens):
    camera = camera_with(lens)
    pixels = np.random.default_rng(1).uniform([0, 0], [319, 239], (20_000, 2))
    image_xy = (pixels - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    rays = camera.domain.undistort(image_xy)
    assert np.abs(distort(camera.distortion, rays) - image_xy).max() < 1e-13


def test_a_fisheye_that_sees_behind_itself_is_refused():
    camera = replace(
        PINHOLE, fx_px=90.0, fy_px=90.0, distortion=Distortion("kannala_brandt", (0.01, 0, 0, 0))
    )
    assert "85 degrees" in camera_problem(camera)


@pytest.mark.parametrize("lens", LENSES)
def test_good_lenses_are_accepted(lens):
    assert camera_problem(camera_with(lens)) is None


@pytest.mark.parametrize("lens", LENSES)
def test_resized_camera_keeps_the_field_of_view(lens):
    camera = camera_with(lens)
    resized = camera.resized(480)
    assert (resized.width_px, resized.height_px) == (480, 360)
    points = camera.rays(np.random.default_rng(0).uniform([0, 0], [319, 239], (50, 2)))
    np.testing.assert_allclose(resized.project(points) + 0.5, 1.5 * (camera.project(points) + 0.5))


def test_a_lens_that_folds_between_centre_and_border_is_refused():
    """Its border is one to one; inside the image OpenCV's own map turns its orientation."""
    lens = Distortion("brown_conrady", (-0.06, 0.127, -0.055, 0.004, -0.069))
    camera = replace(
        PINHOLE,
        width_px=640,
        height_px=480,
        fx_px=400.0,
        fy_px=400.0,
        cx_px=319.5,
        cy_px=239.5,
        distortion=lens,
    )
    assert "tangential" in camera_problem(camera)
    mild = replace(camera, distortion=Distortion("brown_conrady", (-0.06, 0.127, -0.0055, 0.0004, -0.069)))
    assert camera_problem(mild) is None


def test_half_angle_is_that_of_the_corner_farthest_off_the_axis():
    x, y = (320 - 0.5 - 155.0) / 300, (122.0 + 0.5) / 310
    assert PINHOLE.half_angle_rad() == pytest.approx(np.arctan(np.hypot(x, y)), abs=1e-6)
    wider = replace(PINHOLE, fx_px=150.0, fy_px=155.0)
    assert wider.half_angle_rad() == pytest.approx(np.arctan(2 * np.hypot(x, y)), abs=1e-6)
