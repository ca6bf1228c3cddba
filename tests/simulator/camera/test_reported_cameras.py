"""Camera files that users reported, and similar ones: read completely, or refused with the reason."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import parse_camera, read_camera_file
from flyaround.simulator.camera.lens.formats.registry import CAMERA_FORMATS, camera_text
from flyaround.simulator.errors import UserError
from tests.harness.camera_samples import (
    BASALT,
    BOP,
    KALIBR,
    MATLAB,
    MESSAGE,
    NERF,
    ORB_SLAM_3,
    READ_FILES,
    D,
    K,
    sample,
    without,
)

REPORTS = Path(__file__).parents[2] / "data" / "reports"
EUROC = (752, 480, 458.654, 457.296, 367.215, 248.375)
RADTAN = (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05)
ECHO = (1920, 1200, 1133.1, 1128.0, 960.7, 600.8)
PLAIN = (640, 480, 600.0, 601.0, 320.0, 240.0)
FIVE = (-0.3, 0.1, 0.001, 0.0005, 0.02)
FISHEYE = (0.05, -0.02, 0.004, -0.001)


def check(camera, numbers, model, coefficients=()):
    """The camera has these numbers, and a lens that can be used."""
    found = (camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
    assert found == pytest.approx(numbers)
    assert camera.distortion.model == model
    assert camera.distortion.coefficients == pytest.approx(coefficients)
    camera.camera("x")


@pytest.mark.parametrize(
    ("path", "numbers", "model", "coefficients"),
    [
        ("kalibr_radtan_coefficients/sensor.yaml", EUROC, "brown_conrady", RADTAN),
        ("kalibr_radtan_coefficients/euroc_as_is.yaml", EUROC, "brown_conrady", RADTAN),
        ("yaml_1e-05/cam.yaml", EUROC, "brown_conrady", (*RADTAN[:3], 1e-5)),
        (
            "opencv_python_dist_coeff/calibration.yaml",
            (640, 480, 600, 600, 320, 240),
            "brown_conrady",
            (-0.3, 0.1, 0.001, 0.0005, 0),
        ),
        (
            "opencv_python_dist_coeff/calibration.json",
            (640, 480, 600, 600, 320, 240),
            "brown_conrady",
            (-0.3, 0.1, 0.001, 0.0005, 0),
        ),
        ("ros_D_key/cam.yaml", (640, 480, 369.3, 367.1, 320.7, 203.5), "brown_conrady", (0.1, 0.2, 0, 0, 0)),
        (
            "ros_D_key/coeffs.yaml",
            (640, 480, 369.3, 367.1, 320.7, 203.5),
            "brown_conrady",
            (0.1, 0.2, 0, 0, 0),
        ),
        (
            "ros_camera_model_key/fisheye.yaml",
            (1640, 1232, 1403.97646, 1404.70652, 871.2187, 597.37327),
            "kannala_brandt",
            (0.175653, -0.031772, 0.000362, -0.000719),
        ),
        ("ros2_topic_echo/echo.yaml", ECHO, "kannala_brandt", (-0.01, 0.01, 0, 0)),
        ("ros2_topic_echo/two.yaml", ECHO, "kannala_brandt", (-0.01, 0.01, 0, 0)),
    ],
)
def test_reported_file_is_read_completely(path, numbers, model, coefficients):
    check(read_camera_file(REPORTS / path), numbers, model, coefficients)


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("ros_missing_coefficients/cam.yaml", "has no coefficients"),
        ("unknown_key/cam.yaml", "key xyz_unknown is not known"),
    ],
)
def test_a_reported_file_is_refused(path, says):
    with pytest.raises(UserError, match=says):
        read_camera_file(REPORTS / path)


READ = {
    "none": (),
    "four": FIVE[:4],
    "four_and_0": (*FIVE[:4], 0),
    "five": FIVE,
    "eight": (*FIVE, 0, 0, 0),
    "fisheye": FISHEYE,
}
"""Coefficients of the files in the folder of this name."""


@pytest.mark.parametrize("path", READ_FILES)
def test_the_same_camera_is_read_from_each_program_s_file(path):
    text, coefficients = sample(path), READ[path.partition("/")[0]]
    model = "kannala_brandt" if coefficients == FISHEYE else "brown_conrady" if any(coefficients) else "none"
    camera = parse_camera(text.encode(), "x")
    check(camera, PLAIN, model, coefficients)
    # a BOM and Windows' ends of lines change nothing
    assert parse_camera(text.replace("\n", "\r\n").encode("utf-8-sig"), "x") == camera


def test_first_camera_of_a_rig_is_used_and_reported():
    text = KALIBR + KALIBR.replace("cam0:", "cam1:")
    assert "of cam0, cam1" in parse_camera(text.encode(), "x").notes
    two = json.loads(json.dumps(BASALT))
    two["value0"]["intrinsics"] *= 2
    assert "first of 2" in parse_camera(json.dumps(two).encode(), "x").notes
    assert "first" in parse_camera(ORB_SLAM_3.encode(), "x").notes
    scale_bands = parse_camera((ORB_SLAM_3 + "Camera.newWidth: 320\nCamera.newHeight: 240\n").encode(), "x")
    assert "before the program scales" in scale_bands.notes
    assert scale_bands.width_px == 640
    own_size = parse_camera((ORB_SLAM_3 + "Camera.newWidth: 640\nCamera.newHeight: 480\n").encode(), "x")
    assert "before the program scales" not in own_size.notes


def test_notes_of_another_program_s_file_are_said_and_words_of_the_user_s_own_are_not(caplog):
    two = json.loads(json.dumps(BASALT))
    two["value0"]["intrinsics"] *= 2
    parse_camera(json.dumps(two).encode(), "rig.json")
    assert "rig.json: the first of 2 cameras was taken" in caplog.text
    caplog.clear()
    matrix = [[600, 0, 320], [0, 600, 240], [0, 0, 1]]
    speed = {"Nu": 640, "Nv": 480, "cameraMatrix": matrix}
    parse_camera(json.dumps(speed | {"fpx": 600, "fpy": 600}).encode(), "x")
    assert not caplog.text
    parse_camera(json.dumps(speed | {"fpx": 900, "fpy": 900}).encode(), "x")
    assert "the other keys say 900, 900, 320, 240 px" in caplog.text
    caplog.clear()
    native = (
        '{"width_px": 64, "height_px": 48, "fx_px": 60, "fy_px": 60, "cx_px": 3, "cy_px": 2, "notes": "mine"}'
    )
    assert parse_camera(native.encode(), "x").notes == "mine"
    assert not caplog.text


def test_matlab_s_lens_may_stand_beside_its_intrinsics():
    inside = parse_camera(json.dumps({"Intrinsics": MATLAB} | MATLAB).encode(), "x")
    apart = without(MATLAB, "RadialDistortion", "TangentialDistortion")
    beside = {
        "Intrinsics": apart,
        "RadialDistortion": MATLAB["RadialDistortion"],
        "TangentialDistortion": [0, 0],
    }
    assert inside == parse_camera(json.dumps(MATLAB).encode(), "x")
    assert parse_camera(json.dumps(beside).encode(), "x").distortion.coefficients[:2] == (-0.3, 0.1)


def test_a_key_that_is_both_nested_and_dotted_is_refused():
    with pytest.raises(UserError, match=r"Camera.fx twice"):
        parse_camera(b"Camera: {fx: 500, fy: 500, cx: 320, cy: 240}\nCamera.fx: 400\n", "x")


def test_ignored_stereo_rectification_is_reported():
    c, s = np.cos(0.01), np.sin(0.01)
    text = f"{MESSAGE}r: [{c}, 0, {s}, 0, 1, 0, {-s}, 0, {c}]\np: [550, 0, 300, -60, 0, 550, 240, 0, 0, 0, 1, 0]\n"
    camera = parse_camera(text.encode(), "x")
    check(camera, PLAIN, "brown_conrady", FIVE)
    assert "raw" in camera.notes
    zeros = MESSAGE + "r: [0, 0, 0, 0, 0, 0, 0, 0, 0]\np: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n"
    assert parse_camera(zeros.encode(), "x").notes == ""


@pytest.mark.parametrize(
    ("line", "model", "coefficients"),
    [
        ("SIMPLE_PINHOLE 640 480 600 320.5 240.5", "none", ()),
        ("PINHOLE 640 480 600 600 320.5 240.5", "none", ()),
        ("SIMPLE_RADIAL 640 480 600 320.5 240.5 -0.1", "brown_conrady", (-0.1, 0, 0, 0)),
        ("RADIAL 640 480 600 320.5 240.5 -0.1 0.02", "brown_conrady", (-0.1, 0.02, 0, 0)),
        ("OPENCV 640 480 600 600 320.5 240.5 -0.1 0.02 1e-3 2e-3", "brown_conrady", (-0.1, 0.02, 1e-3, 2e-3)),
        ("SIMPLE_RADIAL_FISHEYE 640 480 600 320.5 240.5 0.1", "kannala_brandt", (0.1, 0, 0, 0)),
        ("RADIAL_FISHEYE 640 480 600 320.5 240.5 0.1 0.02", "kannala_brandt", (0.1, 0.02, 0, 0)),
        ("RADIAL_FISHEYE 640 480 600 320.5 240.5 0 0", "kannala_brandt", (0, 0, 0, 0)),
    ],
)
def test_colmap_camera_models_are_read(line, model, coefficients):
    check(
        parse_camera(f"# cameras\n7 {line}\n".encode(), "x"),
        (640, 480, 600, 600, 320, 240),
        model,
        coefficients,
    )


def test_speed_file_matrix_wins_and_contradictions_are_reported():
    table = {
        "Nu": 640,
        "Nv": 480,
        "fx": 6e-3,
        "fy": 6.01e-3,
        "ppx": 1e-5,
        "ppy": 1e-5,
        "ccx": 320,
        "ccy": 240,
    }
    table |= {"cameraMatrix": json.loads(K), "fx_px": 600.0, "fy_px": 601.0}
    camera = parse_camera(json.dumps(table).encode(), "x")
    check(camera, PLAIN, "none")
    assert camera.pixel_pitch_um == (10, 10)
    assert camera.notes == ""
    for change in ({"fx": 7e-3}, {"ccx": 300}, {"fy_px": 700.0}):
        other = parse_camera(json.dumps(table | change).encode(), "x")
        check(other, PLAIN, "none")
        assert "cameraMatrix was taken" in other.notes


def test_four_coefficients_without_a_model_are_said_to_be_no_fish_eye_s():
    text = f"width: 640\nheight: 480\nK: {K}\nD: [-0.3, 0.1, 0.001, 0.0005]\n"
    camera = parse_camera(text.encode(), "x")
    check(camera, PLAIN, "brown_conrady", FIVE[:4])
    assert "fisheye_model: 1" in camera.notes
    assert parse_camera(f"{text}fisheye_model: 0\n".encode(), "x").notes == ""


def test_nerf_without_a_principal_point_looks_through_the_middle():
    table = without(NERF, "cx", "cy", "fl_x", "fl_y", "k1", "k2", "p1", "p2")
    check(parse_camera(json.dumps(table).encode(), "x"), (640, 480, 600, 600, 319.5, 239.5), "none")


def test_nerf_keys_in_another_spelling_are_read():
    camera = parse_camera(json.dumps(NERF).encode(), "x")
    spelled = {"K1": NERF["k1"], "CX": NERF["cx"], "flX": NERF["fl_x"]}
    table = without(NERF, "k1", "cx", "fl_x")
    assert parse_camera(json.dumps(table | spelled).encode(), "x") == camera
    # keys of a frame precede those of the file, however each is spelled
    framed = table | {"frames": [spelled | {"transform_matrix": []}]}
    assert parse_camera(json.dumps(framed | {"k1": 0.5}).encode(), "x") == camera
    fisheye = without(NERF, "p1", "p2", "camera_model") | {"isFisheye": True}
    assert parse_camera(json.dumps(fisheye).encode(), "x").distortion.model == "kannala_brandt"


@pytest.mark.parametrize("value", [False, 0, "false", "False", "0"])
def test_text_of_a_switch_that_is_off_selects_no_fish_eye(value):
    camera = parse_camera(json.dumps(NERF).encode(), "x")
    assert parse_camera(json.dumps(NERF | {"is_fisheye": value}).encode(), "x") == camera
    table = {"width": 640, "height": 480, "K": json.loads(K), "D": json.loads(D), "fisheye": value}
    assert parse_camera(json.dumps(table).encode(), "x").distortion.model == "brown_conrady"


def test_colmap_cameras_that_are_equal_in_another_notation_are_one():
    text = "1 PINHOLE 640 480 600 601 320 240\n2 PINHOLE 640 480 600.0 6.01e2 320 240\n"
    assert parse_camera(text.encode(), "x") == parse_camera(text.splitlines()[0].encode(), "x")


def test_an_ideal_fish_eye_is_no_pinhole():
    text = f"width: 640\nheight: 480\nK: {K}\nfisheye: true\nD: [0, 0, 0, 0]\n"
    camera = parse_camera(text.encode(), "x").camera("x")
    points = np.array([[0.2, 0.1, 1.0], [-0.3, 0.2, 1.0]])
    expected, _ = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), camera.K, np.zeros(4))
    assert camera.project(points) == pytest.approx(expected[0], abs=1e-6)
    assert camera.unproject(expected[0]) == pytest.approx(points[:, :2], abs=1e-9)


def test_every_format_is_known_by_its_files():
    """Each sample is recognised by the format it stands for, whatever else there is."""
    assert len({form.name for form in CAMERA_FORMATS}) == len(CAMERA_FORMATS) == 12
    with pytest.raises(UserError, match="did you mean kalibr"):
        camera_text(parse_camera(json.dumps(BOP).encode(), "x"), "kalib", "x")
    with pytest.raises(UserError, match="no camera format 'colmap' to write"):
        camera_text(parse_camera(json.dumps(BOP).encode(), "x"), "colmap", "x")
