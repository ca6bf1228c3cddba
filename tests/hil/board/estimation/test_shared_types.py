"""Camera, quaternions, vectors and the board model, on inputs whose answer is known."""

import base64
import json
import resource
import subprocess
import sys
import zlib

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


def packed(data):
    return base64.b64encode(zlib.compress(data)).decode()


def faces(**change):
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]]], "<i2")
    face = {"step_m": 0.1, "corners": packed(corners.tobytes()), "material": [0]}
    return {**face, "plane": [[0, 0, 0, 0]], "children": [[-1, -1]], "members": [[0]], **change}


def outlines(**change):
    rows = (
        np.array([0, 0, 32767], "<i2"),
        np.zeros(6, "<i2"),
        np.array([127, 0, 0] * 2, "i1"),
        np.zeros(2, "u1"),
    )
    lengths = {"center_m": [0, 0, 0], "range_m": 10.0, "step_m": 0.1, "radius_step_m": 0.1}
    return {"views": 1, "points": 2, **lengths, "data": packed(b"".join(r.tobytes() for r in rows)), **change}


NAN, INF, HUGE = float("nan"), float("inf"), 10**400
BAD_INDICES = (1.7, 2**70, INF, NAN, "1")
BAD_LENGTHS = (NAN, INF, HUGE, -1, 0)
BAD_FACES = {
    "step_m": BAD_LENGTHS,
    "plane": [[[NAN, 0, 0, 0]], [[HUGE, 0, 0, 0]]],
    "material": [[k] for k in BAD_INDICES],
    "members": [[[k]] for k in BAD_INDICES],
    "children": [[[-1, k]] for k in BAD_INDICES],
    "corners": [packed(b"0" * 23), packed(b"0" * 25), packed(b"0" * 24)[:-8], "AAAA"],
}
BAD_OUTLINES = {
    **dict.fromkeys(("step_m", "radius_step_m", "range_m"), BAD_LENGTHS),
    **dict.fromkeys(("views", "points"), (1.7, 2**70, INF, NAN, 0, -1, HUGE)),
    "center_m": [[NAN, 0, 0], [HUGE, 0, 0]],
    "data": [packed(b"0" * 10), "AAAA"],
}


def test_faces_and_outlines_are_read():
    model = BoardModel.from_dict({**box_model(), "faces": faces(), "outlines": outlines()})
    assert model.faces.corners[0, 1].tolist() == [0.1, 0, 0]
    assert model.outlines.directions.tolist() == [[0, 0, 1]]


@pytest.mark.parametrize(
    "record",
    [
        {"faces": faces(corners=packed(bytes(1 << 30)))},
        {"outlines": outlines(data=packed(bytes(1 << 30)))},
        {"outlines": outlines(views=1 << 15, points=(1 << 15) - 1, data=packed(bytes(1 << 30)))},
    ],
    ids=["faces", "outlines", "outlines of that size"],
)
def test_a_model_that_unpacks_to_gigabytes_is_refused_before_that(tmp_path, record):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({**box_model(), **record}))
    limit = 1 << 30  # of the address space; a board's packages take less than half

    def bounded():
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    words = [sys.executable, "-m", "flyaround.hil.board", "tcp://127.0.0.1:1", "--model", str(path)]
    done = subprocess.run(words, check=False, stderr=subprocess.PIPE, text=True, preexec_fn=bounded)
    assert done.returncode == 2
    assert "board model has a bad field" in done.stderr
    assert done.stderr.count("\n") == 1


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
        {"mass_kg": HUGE},
        {"keypoints": [{"name": "x", "position_m": [HUGE, 0, 0]}]},
        *({"occluders": {"vertices_m": [[0, 0, 0]] * 3, "triangles": [[0, 1, k]]}} for k in BAD_INDICES),
        *({"faces": faces(**{name: value})} for name, values in BAD_FACES.items() for value in values),
        *(
            {"outlines": outlines(**{name: value})}
            for name, values in BAD_OUTLINES.items()
            for value in values
        ),
    ],
)
def test_a_bad_model_is_refused_with_a_reason(tmp_path, change):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({**box_model(), **change}))
    with pytest.raises(BoardModelError, match="board model"):
        BoardModel.read(path)
    with pytest.raises(BoardModelError, match="cannot be read"):
        BoardModel.read(tmp_path / "missing.json")


@pytest.mark.parametrize(
    "width_px", [0, -1, 640.5, NAN, INF, "640", 10**9, HUGE, None], ids=lambda v: f"{v!r:.9}"
)
def test_a_camera_of_no_whole_size_is_refused(width_px):
    camera = {"width_px": width_px, "height_px": 480, "fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}
    with pytest.raises(BoardModelError, match="camera"):
        CameraIntrinsics.from_dict(camera)
    assert CameraIntrinsics.from_dict({**camera, "width_px": 640.0}).width_px == 640


@pytest.mark.parametrize("number", [NAN, INF, HUGE, None], ids=lambda v: f"{v!r:.9}")
def test_a_camera_has_finite_numbers(number):
    camera = {"width_px": 640, "height_px": 480, "fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}
    for change in (
        {"fx_px": number},
        {"distortion": {"model": "kannala_brandt", "coefficients": [number] * 4}},
    ):
        with pytest.raises(BoardModelError, match="camera"):
            CameraIntrinsics.from_dict({**camera, **change})


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
