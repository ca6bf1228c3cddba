"""Calibrations with a camera matrix: OpenCV's FileStorage and scripts around it, ROS's files, messages and INI.

Pixel (0, 0) is the centre of the top-left pixel; coefficients are in OpenCV's order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.camera.lens.formats.document import plain_name
from flyaround.simulator.camera.lens.formats.keys import Keys
from flyaround.simulator.camera.lens.formats.lens import camera_file, named_model
from flyaround.simulator.camera.lens.formats.yaml_text import yaml_text

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

MATRIX = ("camera_matrix", "camera_mtx", "cam_matrix", "intrinsic_matrix", "mtx", "K")
_COEFFICIENTS = (
    "distortion_coefficients",
    "distortion_coeffs",
    "distortion_coeff",
    "distortion",
    "dist_coeffs",
    "dist_coeff",
    "dist_coefs",
    "dist_coef",
    "dist",
    "D",
)
_WIDTH, _HEIGHT = ("image_width", "width", "img_width", "w"), ("image_height", "height", "img_height", "h")
_SIZE = ("image_size", "img_size", "image_resolution", "resolution", "size")
_MODELS = ("distortion_model", "camera_model", "camera_type", "model", "lens_model")
_FISHEYE = ("fisheye_model", "is_fisheye", "fisheye")
# keys in which a calibration program describes its own run; none affects the lens
_REPORT = """
    date time timestamp created_at user host version comment note notes message description source serial serial_number
    camera_serial camera_id id frame_id frame_name fps nframes nr_of_frames n_images images_used frames_used views_used
    views shots pattern pattern_size aspect_ratio fix_aspect_ratio flag_value rms rms_error rmse ret error total_error
    per_view_errors per_view_error extrinsic_parameters image_points grid_points object_points rvec tvec rvecs tvecs
    stdev_intrinsics std_intrinsics new_camera_matrix new_camera_mtx optimal_camera_matrix new_mtx calibration_time
    calibration_date calibration_id calibration_error
"""
_REPORT_PREFIXES = """
    board chessboard checkerboard charuco aruco square marker num_ reprojection reproj_ avg_ average_reprojection
    mean_ max_reprojection per_view_reprojection
"""
_ROS_MARKS = (
    *("distortion_model", "rectification_matrix", "projection_matrix", "rectification", "projection"),
    *("camera_name", "camera_model", "binning_x", "header", "R", "P"),
)
_CROPPED = "give the calibration of the full image, and crop or bin by [sensor] roi_px and binning"


def is_ros(document: Document) -> bool:
    """Return True for ROS's camera_info as YAML, message or INI."""
    return is_opencv(document) and not document.names.isdisjoint(map(plain_name, _ROS_MARKS))


def is_opencv(document: Document) -> bool:
    """Return True for OpenCV's FileStorage and for scripts' dumps of cv2.calibrateCamera."""
    return not document.names.isdisjoint(map(plain_name, MATRIX))


def read_opencv(document: Document, source: str) -> CameraFile:
    """Read OpenCV's FileStorage (YAML, XML, JSON) or a script's dump.

    Raises
    ------
    UserError
        If a key is unknown, or a lens is not supported.
    """
    return _read(Keys(document.table, source, "OpenCV's calibration"), [])


def read_ros(document: Document, source: str) -> CameraFile:
    """Read ROS's calibration file, a CameraInfo message or an INI file.

    Raises
    ------
    UserError
        If a key is unknown, a lens is not supported, or the image is binned or cropped.
    """
    keys = Keys(document.table, source, "ROS camera_info")
    keys.ignore("header", "translation rotation" if document.syntax == "ini" else "")
    keys.allow("binning_x", 0, 1, advice=_CROPPED)
    keys.allow("binning_y", 0, 1, advice=_CROPPED)
    return _read(keys, _rectified_note(keys))


def _read(keys: Keys, notes: list[str]) -> CameraFile:
    size = _image_size(keys)
    matrix = keys.matrix(*MATRIX)
    if matrix is None:
        raise keys.error("lacks the camera matrix; add it")
    _check_roi(keys, size)
    models = [(key, keys.get(key)) for key in _MODELS]
    models += [(key, "fisheye") for key in _FISHEYE if keys.flag(key)]
    flags = keys.get("flags")
    if "fisheye" in str(flags).lower():
        models.append(("flags", "fisheye"))
    model = named_model(models, keys)
    coefficients = keys.numbers(*_COEFFICIENTS)
    keys.allow("skew", 0, 0.0, advice="calibrate with the skew fixed at 0")
    keys.ignore(_REPORT, prefixes=_REPORT_PREFIXES)
    if model is None:
        model = "brown_conrady" if coefficients else "none"
        if len(coefficients or ()) == 4 and not any(map(keys.find, _FISHEYE)):
            notes.append("the 4 coefficients were read as k1 k2 p1 p2; of a fish-eye, add fisheye_model: 1")
    name = keys.get("camera_name", "name")
    return camera_file(keys, size, matrix, model, coefficients, name=str(name or ""), notes=notes)


def _image_size(keys: Keys) -> list[float]:
    name = keys.find(*_SIZE)
    if name and isinstance(keys.get(name), dict):
        inner = keys.inner(name)
        size: list[float] = [inner.count("width"), inner.count("height")]
        inner.done()
        return size
    size = keys.numbers(*_SIZE) or [keys.count(*_WIDTH), keys.count(*_HEIGHT)]
    if len(size) != 2:
        raise keys.error(f"has an image size of {len(size)} numbers, width and height are needed")
    return size


def _check_roi(keys: Keys, size: list[float]) -> None:
    if not isinstance(keys.get("roi"), dict):
        keys.allow("roi", None, [], [0, 0, 0, 0], advice=_CROPPED)
        return
    roi = keys.inner("roi")
    roi.allow("x_offset", 0, advice=_CROPPED)
    roi.allow("y_offset", 0, advice=_CROPPED)
    roi.allow("width", 0, int(size[0]), advice=_CROPPED)
    roi.allow("height", 0, int(size[1]), advice=_CROPPED)
    roi.ignore("do_rectify")
    roi.done()


def _rectified_note(keys: Keys) -> list[str]:
    """Return a note if R and P describe a rectified image; the raw image of K and D is used."""
    rotation = keys.numbers("rectification_matrix", "rectification", "R")
    projection = keys.numbers("projection_matrix", "projection", "P")
    is_rectified = False
    if rotation is not None and any(rotation):
        R = np.array(rotation)
        # files print three digits and more of a rotation; none of its elements exceeds 1
        if (
            R.size != 9
            or abs(R).max() > 2
            or not np.allclose(R.reshape(3, 3) @ R.reshape(3, 3).T, np.eye(3), atol=1e-3)
        ):
            raise keys.error(
                "has a rectification matrix that is not a rotation; calibrate again or delete it"
            )
        is_rectified |= not np.allclose(R.reshape(3, 3), np.eye(3), atol=1e-9)
    if projection is not None and any(projection):
        if len(projection) != 12:
            raise keys.error(f"has a projection matrix of {len(projection)} numbers, 3 x 4 are needed")
        P = np.array(projection).reshape(3, 4)[:, :3]
        if (matrix := keys.matrix(*MATRIX)) is not None:
            fx, fy, cx, cy = matrix
            is_rectified |= not np.allclose(
                P, np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), rtol=1e-6, atol=1e-6
            )
    if not is_rectified:
        return []
    return ["rectification and projection matrix belong to a rectified image; drawn is the raw one"]


def write_opencv(camera: CameraFile, source: str) -> str:  # noqa: ARG001 - a writer's signature
    """Return the text of OpenCV's FileStorage as YAML."""
    fisheye = camera.distortion.model == "kannala_brandt"
    padded = list(camera.distortion.coefficients) or [0.0] * 5
    return (
        "%YAML:1.0\n---\n"
        f"image_width: {camera.width_px}\nimage_height: {camera.height_px}\n"
        f"fisheye_model: {int(fisheye)}\n"
        + _opencv_matrix("camera_matrix", 3, 3, flat_matrix(camera))
        + _opencv_matrix("distortion_coefficients", len(padded), 1, padded)
    )


def _opencv_matrix(name: str, rows: int, columns: int, data: list[float]) -> str:
    values = ", ".join(repr(float(v)) for v in data)
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {values} ]\n"


def write_ros(camera: CameraFile, source: str) -> str:  # noqa: ARG001 - a writer's signature
    """Return the text of ROS's calibration file."""
    coefficients = list(camera.distortion.coefficients)
    name = (
        "equidistant"
        if camera.distortion.model == "kannala_brandt"
        else "rational_polynomial"
        if len(coefficients) == 8
        else "plumb_bob"
    )
    padded = coefficients + [0.0] * (5 - len(coefficients) if name == "plumb_bob" else 0)
    K = flat_matrix(camera)
    table: dict[str, Any] = {
        "image_width": camera.width_px,
        "image_height": camera.height_px,
        "camera_name": camera.name or "camera",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K},
        "distortion_model": name,
        "distortion_coefficients": {"rows": 1, "cols": len(padded), "data": padded},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": [*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0]},
    }
    return yaml_text(table)


def flat_matrix(camera: CameraFile) -> list[float]:
    """Return the camera matrix in rows."""
    return [camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0]
