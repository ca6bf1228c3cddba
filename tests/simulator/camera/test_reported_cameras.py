"""Camera files that users reported, and similar ones: read completely, or refused with the reason."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from mutations import changed_json, changed_text

from flyaround.simulator.camera.lens.files import parse_camera, read_camera_file
from flyaround.simulator.camera.lens.formats.registry import CAMERA_FORMATS, camera_text
from flyaround.simulator.errors import UserError

REPORTS = Path(__file__).parents[2] / "data" / "reports"
SAMPLES = Path(__file__).parents[2] / "data" / "cameras"
"""Files of one camera as programs write it, in folders by the coefficients that are read of them."""
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


K = "[600, 0, 320, 0, 601, 240, 0, 0, 1]"
D = "[-0.3, 0.1, 0.001, 0.0005, 0.02]"
ROS = f"image_width: 640\nimage_height: 480\ncamera_name: left\ncamera_matrix: {{rows: 3, cols: 3, data: {K}}}\n"
MESSAGE = f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\nd: {D}\nk: {K}\n"


def sample(path):
    """A camera file as its program writes it."""
    return (SAMPLES / path).read_text()


OPENCV_2_XML, ROS_INI = sample("five/opencv2.xml"), sample("five/ros.ini")
KALIBR, VINS = sample("fisheye/kalibr.yaml"), sample("four/vins.yaml")
VINS_FISHEYE = sample("fisheye/vins_fisheye.yaml")
ORB_SLAM_2, ORB_SLAM_3 = sample("five/orb_slam2.yaml"), sample("fisheye/orb_slam3.yaml")
STELLA = sample("five/stella.yaml")
BASALT, BOP = json.loads(sample("fisheye/basalt.json")), json.loads(sample("none/bop.json"))
MATLAB, NERF = json.loads(sample("five/matlab.json")), json.loads(sample("four_and_0/nerf.json"))
READ = {
    "none": (),
    "four": FIVE[:4],
    "four_and_0": (*FIVE[:4], 0),
    "five": FIVE,
    "eight": (*FIVE, 0, 0, 0),
    "fisheye": FISHEYE,
}
"""Coefficients of the files in the folder of this name."""
READ_FILES = sorted(path.relative_to(SAMPLES).as_posix() for path in SAMPLES.glob("*/*"))


@pytest.mark.parametrize("path", READ_FILES)
def test_the_same_camera_is_read_from_each_program_s_file(path):
    text, coefficients = sample(path), READ[path.partition("/")[0]]
    model = "kannala_brandt" if coefficients == FISHEYE else "brown_conrady" if any(coefficients) else "none"
    camera = parse_camera(text.encode(), "x")
    check(camera, PLAIN, model, coefficients)
    # a BOM and Windows' ends of lines change nothing
    assert parse_camera(text.replace("\n", "\r\n").encode("utf-8-sig"), "x") == camera


def without(table, *names):
    return {key: value for key, value in table.items() if key not in names}


REFUSED = {
    # keys
    "unknown key of ros": (
        ROS + "distortion_coeficients: [0.1, 0, 0, 0]\n",
        "did you mean distortion_coefficients",
    ),
    "unknown key of a message": (MESSAGE + "zoom: 2\n", "key zoom is not known"),
    "unknown key of kalibr": (KALIBR + "  shutter: rolling\n", "cam0.shutter"),
    "unknown key beside kalibr's cameras": (KALIBR + "scale: 2\n", "key scale"),
    "unknown key of euroc": ("resolution: [6, 4]\nintrinsics: [1, 1, 1, 1]\nzoom: 1\n", "key zoom"),
    "unknown key of vins": (VINS + "zoom: 1\n", "key zoom"),
    "unknown coefficient of vins": (VINS.replace("   p2:", "   k3: 0.1\n   p2:"), "distortion_parameters.k3"),
    "unknown key of orb-slam": (ORB_SLAM_2 + "Camera.k4: 0.1\n", "Camera.k4"),
    "unknown key of basalt": (json.dumps({"value0": BASALT["value0"] | {"zoom": 1}}), "zoom"),
    "unknown key of bop": (json.dumps(BOP | {"k1": 0.1}), "key k1"),
    "unknown key of nerf": (json.dumps(NERF | {"k5": 0.1}), "key k5"),
    "unknown key of a frame of nerf": (
        json.dumps(NERF | {"frames": [{"k5": 1, "fl_x": 1}]}),
        r"frames\[0\].k5",
    ),
    "other frames of nerf than a list": (json.dumps(NERF | {"frames": {"0": {"k1": 0.3}}}), "not a list"),
    "frame of nerf that is no table": (json.dumps(NERF | {"frames": [3]}), r"frames\[0\] is 3, a table"),
    "skew of nerf in capitals": (json.dumps(NERF | {"SK_X": 0.5}), "sk_x is 0.5"),
    "nerf with two spellings": (json.dumps(NERF | {"K1": 0.1}), "k1 and K1, which say the same"),
    "nerf with a fish-eye of text": (json.dumps(NERF | {"is_fisheye": "maybe"}), "is_fisheye is 'maybe'"),
    "vins fish-eye with other terms": (
        VINS_FISHEYE + "distortion_parameters:\n   k1: 0.3\n",
        "distortion_parameters.k1",
    ),
    "focal lengths of speed that disagree": (
        '{"Nu": 640, "Nv": 480, "fx": 6e-3, "fy": 6e-3, "ppx": 1e-5, "ppy": 1e-5, "fx_px": 9999}',
        "fx_px and fy_px that disagree",
    ),
    "unknown key of matlab": (json.dumps(MATLAB | {"Zoom": 1}), "key Zoom"),
    "unknown key of speed": (
        '{"Nu": 640, "Nv": 480, "cameraMatrix": KKK, "zoom": 1}'.replace("KKK", K),
        "key zoom",
    ),
    "unknown key of ini": (ROS_INI + "\nzoom\n1\n", "key zoom"),
    "unknown key of opencv xml": (OPENCV_2_XML.replace("flagValue", "zoom"), "key zoom"),
    "unknown key of native": (
        '{"width_px": 640, "height_px": 480, "fx_px": 6, "fy_px": 6, "cx_px": 3, "cy_px": 2, "k1": 0.1}',
        "unknown key k1",
    ),
    "two keys for one": (
        ROS + f"distortion_model: plumb_bob\nD: {D}\ndistortion_coefficients: {D}\n",
        "say the same",
    ),
    "two spellings of one key": (ROS + "Camera_Matrix: [1]\n", "say the same"),
    "a key twice in yaml": (ROS + "image_width: 320\n", "image_width a second time"),
    "a key twice in json": ('{"width_px": 640, "width_px": 320}', "width_px twice"),
    "a key twice in a table of yaml": (
        "cam0:\n  intrinsics: [1]\n  intrinsics: [2]\n",
        "intrinsics a second time",
    ),
    "a key twice in xml": (OPENCV_2_XML.replace("nrOfFrames", "image_Width"), "image_Width twice"),
    "a key twice in ini": (ROS_INI + "\ndistortion\n0 0 0 0 0\n", "distortion twice"),
    "native beside others' keys": (
        f'{{"camera": {{"fx_px": 1}}, "K": {K}, "width": 640, "height": 480}}',
        "key camera",
    ),
    # lenses
    "ros, empty list": (
        ROS + "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 0, data: []}\n",
        "no coefficients",
    ),
    "ros, nothing behind the key": (
        ROS + "distortion_model: plumb_bob\ndistortion_coefficients:\n",
        "is empty",
    ),
    "message without d": (MESSAGE.replace(f"d: {D}\n", ""), "no coefficients"),
    "fish-eye without coefficients": (f"width: 640\nheight: 480\nK: {K}\nfisheye: true\n", "no coefficients"),
    "kalibr without": (
        KALIBR.replace("  distortion_coeffs: [0.05, -0.02, 0.004, -0.001]\n", ""),
        "no coefficients",
    ),
    "kalibr without model": (KALIBR.replace("  distortion_model: equidistant\n", ""), "no distortion_model"),
    "vins without": (
        VINS.partition("distortion_parameters")[0] + VINS[VINS.index("projection") :],
        "no coefficients",
    ),
    "vins with half": (VINS.replace("   p1: 0.001\n", ""), "lacks the key p1"),
    "orb-slam with half": (ORB_SLAM_2.replace("Camera.p1: 0.001\n", ""), "lacks the key Camera.p1"),
    "orb-slam fish-eye without": (
        "\n".join(line for line in ORB_SLAM_3.splitlines() if "Camera1.k" not in line),
        "no coefficients",
    ),
    "nerf without": (
        json.dumps(without(NERF, "k1", "k2", "p1", "p2") | {"camera_model": "OPENCV"}),
        "no coefficients",
    ),
    "three coefficients": (f"width: 640\nheight: 480\nK: {K}\nD: [0.1, 0.1, 0]\n", "3 coefficients"),
    "fish-eye with five": (f"width: 640\nheight: 480\nK: {K}\nfisheye: 1\nD: {D}\n", "5 coefficients"),
    "two models": (ROS + f"distortion_model: plumb_bob\ncamera_model: fisheye\nD: {D}\n", "different lenses"),
    "none with coefficients": (ROS + f"distortion_model: none\nD: {D}\n", "without one"),
    "pinhole of nerf with coefficients": (json.dumps(NERF | {"camera_model": "PINHOLE"}), "without one"),
    "realsense's inverse": (
        ROS + f"distortion_model: inverse_brown_conrady\nD: {D}\n",
        "inverse_brown_conrady",
    ),
    "omni": (KALIBR.replace("pinhole", "omni"), "'omni', a lens that is not supported.*calibrate with"),
    "ds": (KALIBR.replace("pinhole", "ds"), "'ds', a lens"),
    "eucm": (KALIBR.replace("pinhole", "eucm"), "'eucm', a lens"),
    "fov": (KALIBR.replace("equidistant", "fov"), "'fov', a lens"),
    "mei": (VINS.replace("PINHOLE", "MEI"), "'MEI', a lens"),
    "scaramuzza": (VINS.replace("PINHOLE", "SCARAMUZZA"), "'SCARAMUZZA', a lens"),
    "equirectangular": (STELLA.replace("perspective", "equirectangular"), "'equirectangular', a lens"),
    "basalt ds": (json.dumps(BASALT).replace("kb4", "ds"), "'ds', a lens"),
    "colmap fov": ("1 FOV 640 480 600 601 320 240 0.1\n", "'FOV', a lens"),
    "colmap thin prism": (f"1 THIN_PRISM_FISHEYE 640 480 {'1 ' * 12}\n", "'THIN_PRISM_FISHEYE', a lens"),
    "nerf equirectangular": (
        json.dumps(NERF | {"camera_model": "EQUIRECTANGULAR"}),
        "'EQUIRECTANGULAR', a lens",
    ),
    "nerf eighth power": (json.dumps(NERF | {"k4": 0.1}), "eighth power"),
    "matlab fish-eye": (
        '{"MappingCoefficients": [1, 2], "ImageSize": [480, 640]}',
        "'fisheyeIntrinsics', a lens",
    ),
    "thin prism": (f"width: 640\nheight: 480\nK: {K}\nD: [{'0, ' * 8}0.1, 0, 0, 0]\n", "thin prism"),
    # matrices and images
    "skew of ros": (ROS.replace("[600, 0,", "[600, 0.5,"), "skew of 0.5"),
    "skew of matlab": (json.dumps(without(MATLAB, "IntrinsicMatrix") | {"Skew": 0.5}), "Skew"),
    "skew of nerf": (json.dumps(NERF | {"sk_x": 0.5}), "sk_x is 0.5"),
    "columns for rows": (
        '{"width": 640, "height": 480, "intrinsic_matrix": [600, 0, 0, 0, 601, 0, 320, 240, 1]}',
        "in row order",
    ),
    "not calibrated": (MESSAGE.replace(K, "[0, 0, 0, 0, 0, 0, 0, 0, 0]"), "not calibrated"),
    "rows and cols of another count": (ROS.replace("cols: 3", "cols: 4"), "rows and cols say 3 x 4"),
    "binned": (MESSAGE + "binning_x: 2\nbinning_y: 2\n", "binning_x is 2"),
    "cropped": (
        MESSAGE + "roi: {x_offset: 10, y_offset: 0, height: 100, width: 100, do_rectify: false}\n",
        "roi.x_offset",
    ),
    "R is not a rotation": (MESSAGE + "r: [1, 2, 3, 4, 5, 6, 7, 8, 9]\n", "not a rotation"),
    "P of nine": (MESSAGE + f"p: {K}\n", "3 x 4"),
    "without image size": (
        f'{{"camera_matrix": {K}, "dist_coeff": {D}}}',
        "lacks the key image_width; add it",
    ),
    "orb-slam without image size": (
        ORB_SLAM_2.replace("Camera.width: 640\n", ""),
        "lacks the key Camera.width",
    ),
    "kalibr without image size": (KALIBR.replace("  resolution: [640, 480]\n", ""), "resolution"),
    "nerf without image size": (json.dumps(without(NERF, "w")), "lacks w and h"),
    "nerf that disagrees": (json.dumps(NERF | {"fl_x": 700}), "delete one"),
    "nerf of two cameras": (
        json.dumps(NERF | {"frames": [{"fl_x": 1.0}, {"fl_x": 2.0}]}),
        "different cameras",
    ),
    "nerf without focal length": (json.dumps(without(NERF, "fl_x", "camera_angle_x")), "camera_angle_x"),
    "colmap of two": (
        "1 PINHOLE 640 480 600 601 320 240\n2 PINHOLE 640 480 600 602 320 240\n",
        "2 cameras that differ",
    ),
    "colmap of a 5000-digit width": (f"1 PINHOLE {'9' * 5000} 480 600 601 320 240\n", "too many digits"),
    "colmap too short": ("1 PINHOLE 640 480 600 601 320\n", "PINHOLE takes fx fy cx cy"),
    "scene_camera of bop": (
        f'{{"0": {{"cam_K": {K}, "depth_scale": 1}}}}',
        "give the data set's camera.json",
    ),
    "skew of matlab, f below 0": (
        json.dumps(without(MATLAB, "IntrinsicMatrix") | {"FocalLength": [-800, 800], "Skew": 0}),
        "focal lengths are -800 and 800",
    ),
    "matlab of three focal lengths": (
        json.dumps(MATLAB | {"FocalLength": [600, 601, 5]}),
        "2 numbers as FocalLength, not 3",
    ),
    "matlab of one focal length": (
        json.dumps(without(MATLAB, "IntrinsicMatrix") | {"FocalLength": 800}),
        "2 numbers as FocalLength, not 1",
    ),
    "matlab without principal point": (
        json.dumps(without(MATLAB, "PrincipalPoint")),
        "2 numbers as PrincipalPoint, not 0",
    ),
    "matlab of two matrices": (
        json.dumps(
            without(MATLAB, "FocalLength", "PrincipalPoint") | {"K": [[7, 0, 3], [0, 7, 3], [0, 0, 1]]}
        ),
        "key K that disagrees with IntrinsicMatrix",
    ),
    "matlab of four radial terms": (
        json.dumps(MATLAB | {"RadialDistortion": [1, 2, 3, 4]}),
        "4 radial and 2 tangential terms, allowed",
    ),
    "infinite text": (json.dumps(MATLAB | {"ImageSize": ["1e999", 640]}), "ImageSize holds '1e999', finite"),
    "matlab that disagrees": (json.dumps(MATLAB | {"FocalLength": [500, 601]}), "disagrees"),
    "matlab of two focal lengths": (
        json.dumps({"Intrinsics": MATLAB, "FocalLength": [500, 501]}),
        "FocalLength beside Intrinsics that disagrees",
    ),
    "matlab of two counts of terms": (
        json.dumps({"Intrinsics": MATLAB, "RadialDistortion": [-0.3, 0.1]}),
        "RadialDistortion beside Intrinsics that disagrees",
    ),
    "matlab of a matrix beside": (
        json.dumps(
            {"Intrinsics": without(MATLAB, "IntrinsicMatrix"), "K": [[7, 0, 3], [0, 7, 3], [0, 0, 1]]}
        ),
        "K that disagrees",
    ),
    "unknown key in matlab's intrinsics": (
        json.dumps({"Intrinsics": MATLAB | {"Zoom": 1}}),
        "Intrinsics.Zoom",
    ),
    "matlab without image size": (json.dumps(MATLAB | {"ImageSize": []}), "ImageSize"),
    "vins of two files": (
        "%YAML:1.0\ncam0_calib: cam0.yaml\nimage_width: 640\nimage_height: 480\n",
        "cam0.yaml",
    ),
    "speed, pitch 0": (
        '{"Nu": 640, "Nv": 480, "ppx": 0, "ppy": 1e-5, "cameraMatrix": KKK}'.replace("KKK", K),
        "ppx is 0",
    ),
    "speed, f below 0": (
        '{"Nu": 640, "Nv": 480, "fx": -0.01, "fy": 0.01, "ppx": 1e-5, "ppy": 1e-5}',
        "fx is -0.01",
    ),
    "speed, f below 0 beside its matrix": (
        '{"Nu": 640, "Nv": 480, "fx": -0.01, "cameraMatrix": KKK}'.replace("KKK", K),
        "fx is -0.01",
    ),
    "speed, lengths that disagree with fpx": (
        '{"Nu": 640, "Nv": 480, "fx": 0.01, "fy": 0.01, "ppx": 1e-5, "ppy": 1e-5, "fpx": 900, "fpy": 900}',
        "fpx and fpy",
    ),
    "speed, two focal lengths in pixels": (
        '{"Nu": 640, "Nv": 480, "cameraMatrix": KKK, "fx_px": 600, "fpx": 600}'.replace("KKK", K),
        "fx_px and fpx, which say the same",
    ),
    "radtan of eight": (
        KALIBR.replace("equidistant", "radtan").replace("-0.001]", "-0.001, 0, 0, 0.1, 0]"),
        "radtan takes",
    ),
    # text
    "sexagesimal": (f"width: 10:40\nheight: 480\nK: {K}\n", "'10:40', a number is needed"),
    "truth for a number": (f"width: true\nheight: 480\nK: {K}\n", "a number is needed"),
    "underscores": (f"width: 640\nheight: 480\nK: {K}\nD: [1_0, 0, 0, 0]\n", "numbers are needed"),
    "text nan": (f"width: 640\nheight: 480\nK: {K}\nD: nan 0 0 0\n", "numbers are needed"),
    "infinite": (f"width: 640\nheight: 480\nK: {K}\nD: [.inf, 0, 0, 0]\n", "finite"),
    "two documents": (VINS.replace("%YAML:1.0\n", "") + "---\na: 1\n", "several YAML documents"),
    "python objects": ("K: !!python/object/apply:numpy.core.multiarray._reconstruct\n  args: []\n", "tolist"),
    "anchors": ("a: &x [1]\nb: *x\n", "another place"),
    "entities": (
        "<!DOCTYPE a [<!ENTITY b 'c'>]><opencv_storage><a>&b;</a></opencv_storage>",
        "document type",
    ),
    "xml of others": ("<?xml version='1.0'?><calibration><f>1</f></calibration>", "root is calibration"),
    "cut xml": (OPENCV_2_XML[:-30], "not OpenCV's XML"),
    "none of them": ('{"a": 1, "b": 2}', r"none of the camera files that are read \(its keys are a, b\)"),
    "a scene of blender": ('{"fov": 0.7, "width": 640}', "none of the camera files"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_unsupported_camera_file_is_refused(name):
    text, says = REFUSED[name]
    with pytest.raises(UserError, match=says) as caught:
        parse_camera(text.encode(), "mine.txt").camera("mine.txt")
    assert "mine.txt" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"v/1\x01\x02\0\0\0", "OpenEXR"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"PK\x03\x04", "npz"),
        (b"\x93NUMPY\x01\0", "NumPy"),
        (b"MATLAB 5.0 MAT-file", r"\.mat file"),
        (b"\x80\x04\x95", "pickle"),
        (b"\x01\0\0\0\x02\0\0\0", "binary file|UTF-16"),  # COLMAP's cameras.bin
        ("width: 640".encode("utf-16"), "UTF-16"),
        (b"", "JSON or YAML"),
    ],
)
def test_error_names_a_binary_file(data, says):
    with pytest.raises(UserError, match=says):
        parse_camera(data, "a")


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


def test_files_changed_at_random_are_read_or_refused_in_a_sentence():
    rng = np.random.default_rng(5)
    texts = [text.encode() for text in (*map(sample, READ_FILES), *(text for text, _ in REFUSED.values()))]
    for _ in range(600):
        text = texts[int(rng.integers(len(texts)))]
        try:
            data = changed_json(json.loads(text), rng)
        except ValueError:  # a sample that is no JSON
            data = changed_text(text, rng)
        said = ""
        try:
            parse_camera(data, "x").camera("x")
        except UserError as error:
            said = str(error)
        assert "\n" not in said, data


def test_every_format_is_known_by_its_files():
    """Each sample is recognised by the format it stands for, whatever else there is."""
    assert len({form.name for form in CAMERA_FORMATS}) == len(CAMERA_FORMATS) == 12
    with pytest.raises(UserError, match="did you mean kalibr"):
        camera_text(parse_camera(json.dumps(BOP).encode(), "x"), "kalib", "x")
    with pytest.raises(UserError, match="no camera format 'colmap' to write"):
        camera_text(parse_camera(json.dumps(BOP).encode(), "x"), "colmap", "x")
