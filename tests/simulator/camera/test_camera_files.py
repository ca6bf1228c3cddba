"""Camera files: round trips through every format, files written by OpenCV, one-sentence errors."""

import json
import subprocess
import tracemalloc
from dataclasses import replace
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
import yaml

from flyaround.simulator.camera.detector.limits import optics_problem, sensor_problem
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.files import parse_camera, read_camera_file
from flyaround.simulator.camera.lens.files_native import CameraFile, DistortionSection
from flyaround.simulator.camera.lens.formats.registry import WRITABLE_FORMATS, camera_text
from flyaround.simulator.camera.sections import OpticsSection
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario

BROWN = CameraFile(
    width_px=1920,
    height_px=1200,
    fx_px=2988.58,
    fy_px=2988.34,
    cx_px=960.25,
    cy_px=600.5,
    distortion=DistortionSection("brown_conrady", (-0.22383, 0.51410, -0.000665, -0.000214)),
)
FIVE = msgspec.structs.replace(
    BROWN, distortion=DistortionSection("brown_conrady", (-0.22383, 0.5141, -0.000665, -0.000214, -0.1312419))
)
EIGHT = msgspec.structs.replace(
    BROWN, distortion=DistortionSection("brown_conrady", (0.3, 0.1, 0.001, 0.0005, 0.02, 0.5, 0.15, 0.01))
)
FISHEYE = msgspec.structs.replace(
    BROWN,
    fx_px=900.0,
    fy_px=901.0,
    distortion=DistortionSection("kannala_brandt", (0.05, -0.02, 0.004, -0.001)),
)
PLAIN = msgspec.structs.replace(BROWN, distortion=DistortionSection())


@pytest.mark.parametrize("form", WRITABLE_FORMATS)
@pytest.mark.parametrize(
    "camera", [PLAIN, BROWN, FIVE, EIGHT, FISHEYE], ids=["plain", "brown", "five", "eight", "fisheye"]
)
def test_camera_round_trips_through_every_format(camera, form):
    count = len(camera.distortion.coefficients)
    fisheye = camera is FISHEYE
    if (form == "kalibr" and count > 4) or (form == "speed" and fisheye):
        with pytest.raises(UserError, match="write opencv"):
            camera_text(camera, form, "x")
        return
    back = parse_camera(camera_text(camera, form, "x").encode(), "x")
    assert (back.width_px, back.height_px) == (1920, 1200)
    for name in ("fx_px", "fy_px", "cx_px", "cy_px"):
        assert getattr(back, name) == getattr(camera, name)
    assert back.distortion.model == camera.distortion.model
    found = np.zeros(8)
    found[: len(back.distortion.coefficients)] = back.distortion.coefficients
    assert found[:count].tolist() == list(camera.distortion.coefficients)
    back.camera("x")


def test_what_opencv_writes_is_read(tmp_path):
    path = tmp_path / "opencv.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1920)
    storage.write("image_height", 1200)
    storage.write("camera_matrix", np.array([[2988.58, 0, 960.25], [0, 2988.34, 600.5], [0, 0, 1]]))
    storage.write("distortion_coefficients", np.array(FIVE.distortion.coefficients)[:, None])
    storage.release()
    assert read_camera_file(path).distortion == FIVE.distortion
    # and OpenCV reads what this project writes
    path.write_text(camera_text(FIVE, "opencv", "x"))
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_matrix").mat()[0, 2] == 960.25
    assert storage.getNode("distortion_coefficients").mat().ravel().tolist() == list(
        FIVE.distortion.coefficients
    )


# what `convert` of ROS's camera_calibration_parsers 1.12 (Debian 12) wrote of a file of this project's
ROS_OWN = """image_width: 1920
image_height: 1200
camera_name: head_camera
camera_matrix:
  rows: 3
  cols: 3
  data: [2988.5795163815555, 0, 960.25, 0, 2988.3401159176124, 600.5, 0, 0, 1]
distortion_model: rational_polynomial
distortion_coefficients:
  rows: 1
  cols: 8
  data: [0.29999999999999999, 0.10000000000000001, 0.001, 0.00050000000000000001, 0.02, 0.5, 0.14999999999999999, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [2988.5795163815555, 0, 960.25, 0, 0, 2988.3401159176124, 600.5, 0, 0, 0, 1, 0]"""
ROS_CONVERT = Path("/usr/lib/camera_calibration_parsers/convert")


def test_what_ros_writes_is_read():
    camera = parse_camera(ROS_OWN.encode(), "x")
    assert (camera.name, camera.width_px, camera.height_px) == ("head_camera", 1920, 1200)
    assert (camera.fx_px, camera.fy_px) == (2988.5795163815555, 2988.3401159176124)
    assert camera.distortion == EIGHT.distortion


@pytest.mark.skipif(not ROS_CONVERT.exists(), reason="needs Debian's camera-calibration-parsers-tools")
@pytest.mark.parametrize("camera", [PLAIN, FIVE, EIGHT, FISHEYE], ids=["plain", "five", "eight", "fisheye"])
def test_ros_s_own_program_reads_and_rewrites_what_is_written(camera, tmp_path):
    ours, theirs = tmp_path / "ours.yaml", tmp_path / "theirs.yaml"
    ours.write_text(camera_text(camera, "ros", "x"))
    subprocess.run([ROS_CONVERT, ours, theirs], check=True, capture_output=True)
    assert read_camera_file(theirs) == read_camera_file(ours)


def test_the_pitch_of_a_camera_s_file_is_the_sensor_s(tmp_path):
    sheet = {"width_px": 640, "height_px": 480, "focal_length_mm": 12.0, "pixel_pitch_um": [4.0, 8.0]}
    path = tmp_path / "oblong.json"
    path.write_text(json.dumps(sheet))
    camera = read_camera_file(path)
    assert camera.pixel_pitch_um == (4.0, 8.0)
    assert parse_camera(camera_text(camera, "speed", "x").encode(), "x").pixel_pitch_um == (4.0, 8.0)
    scenario = msgspec.structs.replace(load_scenario("tango-space-10m"), camera=camera)
    assert scenario.sensor_model.pixel_pitch_x_m == pytest.approx(4e-6)
    assert scenario.sensor_model.pixel_pitch_y_m == pytest.approx(8e-6)
    named = msgspec.structs.replace(
        scenario, sensor=msgspec.structs.replace(scenario.sensor, preset="imx174")
    )
    with pytest.raises(UserError, match=r"4 x 8 um, detector imx174 has 5\.86"):
        _ = named.sensor_model


def test_speed_plus_s_own_file_is_read():
    table = {
        "Nu": 1920,
        "Nv": 1200,
        "ppx": 5.86e-6,
        "ppy": 5.86e-6,
        "fx": 0.017513075965995915,
        "fy": 0.017511673079277208,
        "ccx": 960,
        "ccy": 600,
        "cameraMatrix": [[2988.5795163815555, 0, 960], [0, 2988.3401159176124, 600], [0, 0, 1]],
        "distCoeffs": [
            -0.22383016606510672,
            0.51409797089106379,
            -0.00066499611998340662,
            -0.00021404771667484594,
        ],
    }
    camera = parse_camera(json.dumps(table).encode(), "x")
    assert camera.fx_px == pytest.approx(0.017513075965995915 / 5.86e-6)
    assert camera.distortion.model == "brown_conrady"


@pytest.mark.parametrize(
    ("keys", "fx", "fy"),
    [
        ({"focal_length_mm": 17.6, "pixel_pitch_um": 5.86}, 3003.41297, 3003.41297),
        ({"focal_length_mm": 17.6, "pixel_pitch_um": [5.86, 6.0]}, 3003.41297, 2933.3333),
        ({"focal_length_mm": 17.6, "sensor_size_mm": [11.2512, 7.032]}, 3003.41297, 3003.41297),
        ({"aperture_angle_deg": 35.452}, 3003.4, 3003.4),
        ({"focal_length_mm": 17.6, "pixel_pitch_um": 5.86, "aperture_angle_deg": 35.452}, 3003.41, 3003.41),
        # an angle across and oblong pixels: one lens before both axes
        ({"aperture_angle_deg": 35.452, "pixel_pitch_um": [5.86, 6.0]}, 3003.4, 2933.3),
        ({"aperture_angle_deg": 35.452, "sensor_size_mm": [11.2512, 7.2]}, 3003.4, 2933.3),
        ({"aperture_angle_deg": [35.452, 22.61], "pixel_pitch_um": 5.86}, 3003.4, 3001.4),
    ],
)
def test_any_consistent_pair_determines_the_intrinsics(keys, fx, fy):
    camera = parse_camera(json.dumps({"width_px": 1920, "height_px": 1200, **keys}).encode(), "x")
    assert (camera.fx_px, camera.fy_px) == (pytest.approx(fx, rel=1e-4), pytest.approx(fy, rel=1e-4))
    assert (camera.cx_px, camera.cy_px) == (959.5, 599.5)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"width_px": 1920, "height_px": 1200, "focal_length_mm": 17.6}', "not fixed"),
        (
            (
                '{"width_px": 1920, "height_px": 1200, "focal_length_mm": 17.6, "pixel_pitch_um": 5.86, '
                '"aperture_angle_deg": 50}'
            ),
            "leave one out",
        ),
        (
            '{"width_px": 1920, "height_px": 1200, "pixel_pitch_um": 5.86, "aperture_angle_deg": [35.5, 35.5]}',
            "focal length .mm. is 17.57.* across and 10.98.* down: correct",
        ),
        (
            '{"width_px": 1920, "height_px": 1200, "focal_length_mm": 10, "pixel_pitch_um": 0.005}',
            "pixel_pitch_um.*at least 0.1",
        ),
        (
            '{"width_px": 1920, "height_px": 1200, "aperture_angle_deg": 0.001}',
            "camera of these numbers: key fx_px.*at most",
        ),
        ('{"width_px": 1920, "height_px": 1200, "aperture_angle_deg": 5e-324}', "at least 0.0001"),
        ('{"Nu": 1920, "Nv": 1200, "cameraMatrix": [[0, 0, 960], [0, 0, 600], [0, 0, 1]]}', "singular"),
        ('{"Nu": 1920, "Nv": 1200, "cameraMatrix": [[NaN, 0, 960], [0, 2000, 600], [0, 0, 1]]}', "finite"),
        ("image_width: 640\nimage_height: 480\ncamera_matrix: {data: [1, 2, 3]}\n", "3 x 3"),
        (
            '{"Nu": 640, "Nv": 480, "fx": 0.01, "fy": 0.01, "ppx": 1e-5, "ppy": 1e-5, "ccx": "q"}',
            "ccx is 'q'",
        ),
        ('{"Nu": 640.5, "Nv": 480, "fx": 0.01, "fy": 0.01, "ppx": 1e-5, "ppy": 1e-5}', "whole number"),
        ("cam0: {camera_model: pinhole, intrinsics: [6, 6, 3, 2], resolution: [64.5, 48]}", "whole number"),
        (
            '{"width_px": 640, "height_px": 480, "fx_px": 20, "fy_px": 20, "cx_px": 320, "cy_px": 240}',
            "85 degrees",
        ),
        (
            '{"width_px": 0, "height_px": 48, "fx_px": 60, "fy_px": 60, "cx_px": 32, "cy_px": 24}',
            "at least 16",
        ),
        (
            '{"width_px": 64, "height_px": 48, "fx_px": 60, "fy_px": 60, "cx_px": "middle", "cy_px": 24}',
            "'middle'",
        ),
        ("{", "not JSON"),
        ("a: [1, 2\n", "not YAML"),
        ("just words", "table of keys"),
    ],
)
def test_foreign_file_mistake_gives_a_one_sentence_error(text, says):
    with pytest.raises(UserError, match=says) as caught:
        parse_camera(text.encode(), "mine.yaml").camera("mine.yaml")
    assert "mine.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_lens_that_folds_is_refused_from_a_file():
    folding = msgspec.structs.replace(PLAIN, distortion=DistortionSection("brown_conrady", (-25.0, 0, 0, 0)))
    with pytest.raises(UserError, match="folds back inside the image"):
        parse_camera(camera_text(folding, "ros", "x").encode(), "x").camera("x")


@pytest.mark.parametrize(
    ("optics", "says"),
    [
        (Optics(psf="kernel", kernel=((0.5, 0.2, 0.2),)), "sums to 0.9"),
        (Optics(psf="kernel", kernel=((0.5, 0.5),)), "odd"),
        (Optics(psf="kernel", kernel=((1.2, -0.1, -0.1),)), "negative"),
        (Optics(psf="kernel", kernel=((float("nan"),),)), "finite"),
        (Optics(psf="kernel"), "empty"),
        (Optics(f_number=0.0), "f_number"),
        (Optics(transmission=float("nan")), "transmission"),
    ],
)
def test_invalid_optics_are_refused(optics, says):
    assert says in optics_problem(optics)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"full_well_e": 0.0}, "full_well_e is 0"),
        ({"temperature_c": 200.0, "dark_doubling_c": 1.0}, "dark_current_e_s is"),
        ({"read_noise_e": float("nan")}, "read_noise_e is nan"),
        ({"quantum_efficiency": (1.2,)}, "quantum_efficiency"),
        ({"black_level_dn": 4095.0}, "black_level_dn"),
        ({"binning": 0}, "binning"),
    ],
)
def test_invalid_detectors_are_refused(changes, says):
    sensor = sensor_preset("imx174")
    assert sensor_problem(sensor) is None
    assert says in sensor_problem(replace(sensor, detector=replace(sensor.detector, **changes)))


def test_a_measured_psf_is_read_from_numbers_text_and_pictures(tmp_path):
    kernel = np.array([[1.0, 2.0, 1.0], [2.0, 8.0, 3.0], [1.0, 2.0, 0.0]]) / 20
    np.save(tmp_path / "k.npy", kernel)
    np.savetxt(tmp_path / "k.txt", kernel)
    np.savetxt(tmp_path / "k.csv", kernel, delimiter=",")
    cv2.imwrite(str(tmp_path / "k.png"), np.round(kernel * 60_000).astype(np.uint16))
    for name in ("k.npy", "k.txt", "k.csv", "k.png"):
        section = OpticsSection(psf="kernel", kernel_file=name).with_kernel(tmp_path, "x")
        assert np.array(section.kernel) == pytest.approx(kernel, abs=1e-12)
        assert optics_problem(section.optics()) is None
    cv2.imwrite(str(tmp_path / "colour.png"), np.ones((3, 3, 3), np.uint8))
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((3, 3), np.uint8))
    (tmp_path / "text.png").write_text("no picture")
    for name, says in (
        ("colour.png", "3 axes"),
        ("black.png", "black all over"),
        ("text.png", "not a readable image"),
    ):
        with pytest.raises(UserError, match=says):
            OpticsSection(psf="kernel", kernel_file=name).with_kernel(tmp_path, "x")


@pytest.mark.parametrize("camera", [PLAIN, BROWN, EIGHT, FISHEYE])
@pytest.mark.parametrize("form", ["ros", "opencv"])
def test_matrices_have_as_many_numbers_as_rows_and_columns_say(camera, form):
    text = camera_text(camera, form, "x").replace("%YAML:1.0\n---\n", "").replace("!!opencv-matrix", "")
    matrices = {k: m for k, m in yaml.safe_load(text).items() if isinstance(m, dict)}
    assert len(matrices) == (4 if form == "ros" else 2)
    for name, matrix in matrices.items():
        assert matrix["rows"] * matrix["cols"] == len(matrix["data"]), name
    shapes = {name: (m["rows"], m["cols"]) for name, m in matrices.items() if "distortion" not in name}
    assert shapes.pop("camera_matrix") == (3, 3)
    if form == "ros":
        assert shapes == {"rectification_matrix": (3, 3), "projection_matrix": (3, 4)}
        P = np.reshape(matrices["projection_matrix"]["data"], (3, 4))
        assert np.array_equal(P[:, :3], np.reshape(matrices["camera_matrix"]["data"], (3, 3)))
        assert not P[:, 3].any()


def test_a_picture_of_a_kernel_is_measured_before_it_is_divided(tmp_path):
    assert cv2.imwrite(str(tmp_path / "large.png"), np.full((6000, 6000), 9, np.uint8))
    tracemalloc.start()
    with pytest.raises(UserError, match="6000 x 6000 pixels, at most 63 a side"):
        OpticsSection(psf="kernel", kernel_file="large.png").with_kernel(tmp_path, "x")
    assert tracemalloc.get_traced_memory()[1] < 100_000_000  # as floats it has 288 MB
    tracemalloc.stop()
