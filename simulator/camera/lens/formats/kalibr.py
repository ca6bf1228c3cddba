"""Cameras of visual-inertial calibration: Kalibr's camchain and EuRoC's sensor.yaml, Basalt's JSON.

Pixel (0, 0) is the centre of the top-left pixel; coefficients are in OpenCV's order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.simulator.camera.lens.formats.keys import Keys, flat_numbers
from flyaround.simulator.camera.lens.formats.lens import camera_file, named_model, unsupported_model
from flyaround.simulator.camera.lens.formats.yaml_text import yaml_text
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.distortion import DistortionModel
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

# keys that do not affect the image: of a rig, of one sensor, of a Basalt rig
_RIG = """
    T_cn_cnm1 T_cam_imu T_imu_cam T_BS timeshift_cam_imu cam_overlaps overlaps
"""
_SENSOR = """
    sensor_type comment rate_hz rostopic topic label name id camera_id line_delay
"""
_BASALT_RIG = """
    T_imu_cam T_i_c vignette calib_accel_bias calib_gyro_bias imu_update_rate comment accel_noise_std
    gyro_noise_std accel_bias_std gyro_bias_std cam_time_offset_ns view_offset T_mocap_world T_imu_marker
    mocap_time_offset_ns mocap_to_imu_offset_ns
"""
_BASALT_MODELS: dict[str, tuple[DistortionModel, tuple[str, ...]]] = {
    "pinhole": ("none", ()),
    "kb4": ("kannala_brandt", ("k1", "k2", "k3", "k4")),
    "pinhole-radtan8": ("brown_conrady", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    "radtan8": ("brown_conrady", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
}


def is_kalibr(document: Document) -> bool:
    """Return True for a camchain, or a table of one of its cameras."""
    table = document.table
    return (isinstance(table.get("intrinsics"), list) and not is_basalt(document)) or bool(_cameras(table))


def _cameras(table: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in table.items() if isinstance(v, dict) and "intrinsics" in v and k != "value0"}


def read_kalibr(document: Document, source: str) -> CameraFile:
    """Read the first camera of a camchain, or EuRoC's sensor.yaml.

    Raises
    ------
    UserError
        If a key is unknown, or the lens is not supported.
    """
    cameras = _cameras(document.table)
    if not cameras:
        return _read_one(Keys(document.table, source, "EuRoC's sensor.yaml"), "", [])
    chain = Keys(document.table, source, "a Kalibr camchain")
    for camera_name in cameras:
        chain.get(camera_name)
    chain.done()
    name = next(iter(cameras))
    other_names = ", ".join(list(cameras)[1:])
    notes = (
        [f"{name} was taken of {name}, {other_names}; keep one camera in the file to take another"]
        if other_names
        else []
    )
    return _read_one(chain.inner(name), name, notes)


def _read_one(keys: Keys, name: str, notes: list[str]) -> CameraFile:
    kind = keys.get("camera_model")
    if str(kind or "pinhole").lower() != "pinhole":
        raise unsupported_model(f"{keys.where}: key {keys.path}camera_model", kind, "pinhole")
    model = named_model([("distortion_model", keys.get("distortion_model"))], keys)
    size, intrinsics = keys.numbers("resolution"), keys.numbers("intrinsics")
    if size is None or intrinsics is None or len(size) != 2 or len(intrinsics) != 4:
        raise keys.error("needs resolution [width, height] and intrinsics [fx, fy, cx, cy]")
    coefficients = keys.numbers("distortion_coeffs", "distortion_coefficients")
    if model is None and coefficients:
        raise keys.error(
            "has coefficients of a distortion, but no distortion_model; add it: radtan or equidistant"
        )
    if model == "brown_conrady" and len(coefficients or ()) > 5:
        raise keys.error(f"has {len(coefficients or ())} coefficients, radtan takes k1 k2 p1 p2 [k3]")
    keys.ignore(_RIG, _SENSOR)
    return camera_file(keys, size, intrinsics, model or "none", coefficients, name=name, notes=notes)


def write_kalibr(camera: CameraFile, source: str) -> str:
    """Return the text of a camchain of one camera.

    Raises
    ------
    UserError
        If the lens has more coefficients than Kalibr supports.
    """
    coefficients = list(camera.distortion.coefficients)
    if len(coefficients) > 4 and any(coefficients[4:]):
        raise UserError(
            f"{source}: Kalibr's radtan lens has k1 k2 p1 p2 only, this one has {len(coefficients)} coefficients; "
            "write opencv or ros"
        )
    table = {
        "cam0": {
            "camera_model": "pinhole",
            "intrinsics": [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
            "distortion_model": "equidistant" if camera.distortion.model == "kannala_brandt" else "radtan",
            "distortion_coeffs": (coefficients or [0.0] * 4)[:4],
            "resolution": [camera.width_px, camera.height_px],
        }
    }
    return yaml_text(table)


def is_basalt(document: Document) -> bool:
    """Return True for Basalt's calibration.json."""
    table = document.table.get("value0", document.table)
    cameras = table.get("intrinsics") if isinstance(table, dict) else None
    return (
        isinstance(cameras, list)
        and bool(cameras)
        and isinstance(cameras[0], dict)
        and "camera_type" in cameras[0]
    )


def read_basalt(document: Document, source: str) -> CameraFile:
    """Read the first camera of Basalt's calibration.json.

    Raises
    ------
    UserError
        If a key is unknown, or the lens is not supported.
    """
    document_keys = Keys(document.table, source, "a Basalt calibration")
    rig = document_keys.inner("value0") if document_keys.find("value0") else document_keys
    cameras, sizes = rig.get("intrinsics"), rig.get("resolution")
    rig.ignore(_BASALT_RIG)
    rig.done()
    if rig is not document_keys:
        document_keys.done()
    size = flat_numbers(sizes, f"{source}: key resolution") if sizes else []
    if len(size) < 2:
        raise rig.error("lacks the resolution [[width, height]] of its cameras; add it")
    camera = Keys(cameras[0], source, "a Basalt calibration", "intrinsics[0].")
    kind = str(camera.get("camera_type"))
    if kind not in _BASALT_MODELS:
        raise unsupported_model(f"{source}: key intrinsics[0].camera_type", kind, ", ".join(_BASALT_MODELS))
    model, names = _BASALT_MODELS[kind]
    lens = camera.inner("intrinsics")
    camera.done()
    intrinsics = [lens.number(name) for name in ("fx", "fy", "cx", "cy")]
    coefficients = [lens.number(name) for name in names]
    lens.ignore("rpmax")
    n_cameras = len(cameras)
    notes = (
        [f"the first of {n_cameras} cameras was taken; keep one in the file to take another"]
        if n_cameras > 1
        else []
    )
    return camera_file(lens, size[:2], intrinsics, model, coefficients, notes=notes)
