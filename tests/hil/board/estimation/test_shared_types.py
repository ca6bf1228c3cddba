"""Camera, quaternions, vectors and the board model, on inputs whose answer is known."""

import json

import cv2
import numpy as np
import pytest

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.estimation.target_model import BoardModel
from tests.harness.box_model import box_model


def test_quaternions_and_matrices_are_inverse():
    q = quat.normalise(np.random.default_rng(0).normal(size=(200, 4)))
    assert quat.angle_rad(quat.from_matrix(quat.matrix(q)), q).max() < 1e-6
    v = np.array([0.0, 0.0, np.pi / 2])
    assert quat.matrix(quat.from_rotvec(v)) @ [1, 0, 0] == pytest.approx([0, 1, 0])


@pytest.mark.parametrize(
    "change",
    [
        {"schema": "other"},
        {"version": 2},
        {"wireframe": []},
        {"wireframe": [{"name": "x", "a_m": [0, 0], "b_m": [0, 0, 1]}]},
        {"occluders": {"vertices_m": [[0, 0, 0]], "triangles": [[0, 1, 2]]}},
        {"wireframe": [{"name": "x", "a_m": [0, 0, 0], "b_m": [0, 0, 1], "radius_m": float("nan")}]},
        {"wireframe": [{"name": "x", "a_m": [0, 0, 0], "b_m": [0, 0, 1], "radius_m": -1}]},
        {"mass_kg": float("inf")},
        {"symmetry_wxyz": [[0, 0, 0, 0]]},
        {"symmetry_wxyz": [[float("nan"), 0, 0, 0]]},
    ],
)
def test_a_bad_model_is_refused_with_a_reason(tmp_path, change):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({**box_model(), **change}))
    with pytest.raises(BoardModelError, match="board model"):
        BoardModel.read(path)
    with pytest.raises(BoardModelError, match="cannot be read"):
        BoardModel.read(tmp_path / "missing.json")


@pytest.mark.parametrize("width_px", [0, -1, 640.5, float("nan"), "640", 10**9, None])
def test_a_camera_of_no_whole_size_is_refused(width_px):
    camera = {"width_px": width_px, "height_px": 480, "fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}
    with pytest.raises(BoardModelError, match="camera"):
        CameraIntrinsics.from_dict(camera)
    assert CameraIntrinsics.from_dict({**camera, "width_px": 640.0}).width_px == 640


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("brown_conrady", (-0.22, 0.5, -7e-4, -2e-4, -0.13)), ("kannala_brandt", (-0.01, 0.02, -0.01, 0.002))],
)
def test_distortion_is_opencvs_and_undone(model, coefficients):
    camera = CameraIntrinsics(640, 480, 800.0, 810.0, 320.0, 240.0, model, coefficients)
    points = np.random.default_rng(1).uniform([-0.3, -0.2, 1], [0.3, 0.2, 1], (50, 3))
    K = np.array([[800.0, 0, 320], [0, 810, 240], [0, 0, 1]])
    d = np.array(coefficients)
    if model == "brown_conrady":
        expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, d)[0]
    else:
        expected = cv2.fisheye.projectPoints(points.reshape(1, -1, 3), np.zeros(3), np.zeros(3), K, d)[0]
    pixels = camera.pixels(points)
    assert np.abs(pixels - np.asarray(expected).reshape(-1, 2)).max() < 1e-9
    assert np.abs(undistorted_rays(camera, pixels) - points[:, :2]).max() < 1e-6
