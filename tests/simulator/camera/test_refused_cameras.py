"""Camera files that are refused with the reason: unsupported lenses, contradictions, damage."""

import json

import numpy as np
import pytest
from mutations import changed_json, changed_text

from flyaround.simulator.camera.lens.files import parse_camera
from flyaround.simulator.errors import UserError
from tests.harness.camera_samples import (
    BASALT,
    BOP,
    KALIBR,
    MATLAB,
    MESSAGE,
    NERF,
    OPENCV_2_XML,
    ORB_SLAM_2,
    ORB_SLAM_3,
    READ_FILES,
    ROS,
    ROS_INI,
    STELLA,
    VINS,
    VINS_FISHEYE,
    D,
    K,
    sample,
    without,
)

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
