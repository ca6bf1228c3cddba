"""A lens that bends: points are undistorted, never the picture."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_craft import CAMERA, NOISE_DN, Craft

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import undistorted_rays
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.evaluate.pose_errors import frame_errors

pytestmark = pytest.mark.usefixtures("one_thread")
SUN = np.array([0.3, -0.2, -0.93])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("brown_conrady", (-0.35, 0.1, 1e-3, -5e-4, 0.0)), ("kannala_brandt", (-0.1, 0.02, 0.0, 0.0))],
)
def test_a_craft_far_off_the_axis_is_found_through_the_lens(
    model: str, coefficients: tuple[float, ...]
) -> None:
    """Bent by more than five pixels where the craft is: the pose is right with the lens known, and worse without."""
    camera = replace(CAMERA, distortion_model=model, distortion=coefficients)
    q, t = quat.normalise(np.array([0.6, 0.6, -0.4, 0.3])), np.array([1.05, 0.55, 4.6])
    rng = np.random.default_rng(9)
    straight = Craft().picture(q, t, SUN, rng, noise_dn=0.0)
    # what falls on each pixel of the bent picture came from here on the straight one
    v, u = np.mgrid[: CAMERA.height_px, : CAMERA.width_px]
    rays = undistorted_rays(camera, np.stack([u.ravel(), v.ravel()], axis=-1))
    at = (rays * (CAMERA.fx_px, CAMERA.fy_px) + (CAMERA.cx_px, CAMERA.cy_px)).reshape(*u.shape, 2)
    bent = cv2.remap(straight, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32), cv2.INTER_LINEAR)
    # the detector's noise comes after the lens: bent with the picture it would be smoothed and look like texture
    bent = np.clip(bent + rng.normal(0, NOISE_DN, bent.shape) + 0.5, 0, 255).astype(np.uint8)
    assert np.hypot(*(at[420, 820] - (820, 420))) > 5
    errors = []
    for known in (camera, CAMERA):
        result = make_estimator(Craft().model(), known).estimate(np.ascontiguousarray(bent))
        assert result.q_camera_from_target_wxyz is not None
        errors.append(frame_errors(q, t, result.q_camera_from_target_wxyz, result.t_camera_from_target_m))
    assert errors[0][1] < 0.01
    assert errors[0][2] < 1.0
    assert errors[1][0] > 3 * errors[0][0]


NUMBERS = {"width_px": 640, "height_px": 480, "fx_px": 300.0, "fy_px": 301.0, "cx_px": 320.0, "cy_px": 240.0}


def test_an_ideal_fish_eye_bends():
    lens = {"model": "kannala_brandt", "coefficients": [0.0] * 4}
    camera = CameraIntrinsics.from_dict({**NUMBERS, "distortion": lens})
    points = np.array([[0.4, 0.1, 1.0], [-0.5, 0.7, 1.0]])
    K = np.array([[300.0, 0, 320], [0, 301, 240], [0, 0, 1]])
    expected, _ = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), K, np.zeros(4))
    assert camera.distorted
    assert camera.pixels(points) == pytest.approx(expected[0], abs=1e-6)


@pytest.mark.parametrize(
    ("model", "count"), [("kannala_brandt", 0), ("brown_conrady", 0), ("brown_conrady", 3), ("none", 4)]
)
def test_a_lens_has_its_coefficients(model, count):
    with pytest.raises(BoardModelError, match=f"{count} coefficients"):
        CameraIntrinsics.from_dict({**NUMBERS, "distortion": {"model": model, "coefficients": [0.0] * count}})
