"""Settings of SLAM programs: ORB-SLAM 2 and 3, stella_vslam, and VINS with its pinhole and Kannala-Brandt models.

Pixel (0, 0) is the centre of the top-left pixel; coefficients are in OpenCV's order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.simulator.camera.lens.formats.keys import Keys
from flyaround.simulator.camera.lens.formats.lens import camera_file, unsupported_model
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.distortion import DistortionModel
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

_PINHOLES, _FISHEYES = ("pinhole", "perspective"), ("kannalabrandt8", "fisheye")
# settings of the program, of a second camera, and of images that it rectifies itself
_ORB_OTHERS = """
    ORBextractor. Extractor. Feature. Viewer. PangolinViewer. SocketPublisher. System. IMU. Stereo. RGBD. LEFT.
    RIGHT. Initializer. Tracking. Mapping. LoopDetector. LoopClosing. Relocalizer. Preprocessing.
    KeyframeInserter. MapPublisher. StereoRectifier. GraphOptimizer. Camera2. File. depthmap Tracker. LocalMap.
    Camera.lapping Camera1.overlapping Camera1.lapping
"""
_ORB_CAMERA = """
    Camera.name Camera.setup Camera.fps Camera.RGB Camera.color_order Camera.bf Camera.baseline
    Camera.focal_x_baseline Camera.depth_threshold Camera.depthmap_factor ThDepth DepthMapFactor Tbc Tlr Tbc0
    loopClosing thFarPoints bFishEye
"""
_VINS_OTHERS = """
    imu num_of_cam imu_topic image_topic image0_topic image1_topic output_path camera_name estimate_extrinsic
    extrinsicRotation extrinsicTranslation body_T_cam0 body_T_cam1 max_cnt min_dist freq F_threshold show_track
    flow_back equalize max_solver_time multiple_thread max_num_iterations keyframe_parallax acc_n gyr_n acc_w
    gyr_w g_norm loop_closure load_previous_pose_graph fast_relocalization pose_graph_save_path estimate_td td
    save_image rolling_shutter rolling_shutter_tr visualize_imu_forward visualize_camera_size fisheye
"""


def is_orb(document: Document) -> bool:
    """Return True for settings of ORB-SLAM or stella_vslam."""
    keys = [str(key) for key in document.table]
    nested = document.table.get("Camera")
    return any(key.startswith(("Camera.", "Camera1.")) for key in keys) or (
        isinstance(nested, dict) and "fx" in nested
    )


def read_orb(document: Document, source: str) -> CameraFile:
    """Read the camera of ORB-SLAM's or stella_vslam's settings; the first one of a stereo pair.

    Raises
    ------
    UserError
        If a key of the camera is unknown, or its lens is not supported.
    """
    table: dict[str, Any] = {}
    for section, value in document.table.items():
        nested = isinstance(value, dict) and "data" not in value
        entries = {f"{section}.{key}": v for key, v in value.items()} if nested else {section: value}
        for key in entries.keys() & table.keys():
            raise UserError(f"{source} has the key {key} twice, nested and dotted; delete one")
        table |= entries
    keys = Keys(table, source, "ORB-SLAM or stella_vslam settings")
    kind = str(keys.get("Camera.type", "Camera.model") or "pinhole")
    lens_type = kind.lower()
    if lens_type not in (*_PINHOLES, *_FISHEYES, "rectified"):
        raise unsupported_model(
            f"{source}: key Camera.type", kind, "PinHole, KannalaBrandt8, Rectified, perspective, fisheye"
        )
    intrinsics = [keys.number(*_spelled(name)) for name in ("fx", "fy", "cx", "cy")]
    size = [
        keys.count("Camera.width", "Camera.cols", "Camera1.width"),
        keys.count("Camera.height", "Camera.rows", "Camera1.height"),
    ]
    notes = []
    unscaled = {"newWidth": size[0], "newHeight": size[1], "imageScale": 1}
    scales = {key: keys.get(f"Camera.{key}") for key in unscaled}
    if any(scales[key] not in (None, value) for key, value in unscaled.items()):
        notes.append("this is the camera before the program scales its images")
    model, coefficients = _orb_lens(keys, lens_type)
    keys.ignore(_ORB_CAMERA, prefixes=_ORB_OTHERS)
    if any(str(name).startswith("LEFT.") for name in table):
        notes.append("the camera is that of the rectified images (Camera.*), not of the raw ones (LEFT.K)")
    elif any(str(name).startswith("Camera2.") for name in table):
        notes.append("of two cameras the first was taken")
    return camera_file(
        keys, size, intrinsics, model, coefficients, name=str(keys.get("Camera.name") or ""), notes=notes
    )


def _spelled(name: str) -> tuple[str, str]:
    return f"Camera.{name}", f"Camera1.{name}"


def _orb_lens(keys: Keys, kind: str) -> tuple[DistortionModel, list[float] | None]:
    """Return model and coefficients; a pinhole without coefficients has no distortion."""
    names = ("k1", "k2", "k3", "k4") if kind in _FISHEYES else ("k1", "k2", "p1", "p2")
    coefficient_names = [name for name in names if keys.find(*_spelled(name))]
    if kind in _FISHEYES:
        return "kannala_brandt", [
            keys.number(*_spelled(name)) for name in names
        ] if coefficient_names else None
    k3 = keys.find(*_spelled("k3"))
    if not coefficient_names and not k3:
        return "none", None
    coefficients = [keys.number(*_spelled(name)) for name in names]
    if k3:
        coefficients.append(keys.number(*_spelled("k3")))
    if kind == "rectified":
        return "none", coefficients
    return "brown_conrady", coefficients


def is_vins(document: Document) -> bool:
    """Return True for a camera of VINS (camodocal)."""
    return any(key in document.table for key in ("model_type", "projection_parameters", "cam0_calib"))


def read_vins(document: Document, source: str) -> CameraFile:
    """Read a camera of VINS-Mono or VINS-Fusion.

    Raises
    ------
    UserError
        If a key is unknown, or the lens is not supported.
    """
    keys = Keys(document.table, source, "VINS settings")
    if keys.find("cam0_calib"):
        raise UserError(
            f"{source} names its camera in another file: give that one, {str(keys.get('cam0_calib'))[:60]!r}"
        )
    kind = str(keys.get("model_type") or "")
    if kind not in ("PINHOLE", "KANNALA_BRANDT"):
        raise unsupported_model(f"{source}: key model_type", kind, "PINHOLE, KANNALA_BRANDT")
    size = [keys.count("image_width"), keys.count("image_height")]
    projection = keys.inner("projection_parameters")
    lens = keys.inner("distortion_parameters") if keys.find("distortion_parameters") else None
    model: DistortionModel
    if kind == "PINHOLE":
        intrinsics = [projection.number(name) for name in ("fx", "fy", "cx", "cy")]
        model, names = "brown_conrady", ("k1", "k2", "p1", "p2")
    else:
        intrinsics = [projection.number(name) for name in ("mu", "mv", "u0", "v0")]
        # camodocal's k2 is OpenCV's k1: the coefficient of the angle cubed
        model, names = "kannala_brandt", ("k2", "k3", "k4", "k5")
        if lens is None or not lens.find("k2"):
            if lens is not None:
                lens.done()
            lens = projection
    coefficients = None if lens is None else [lens.number(name) for name in names]
    projection.done()
    if lens is not None:
        lens.done()
    name = str(keys.get("camera_name") or "")
    keys.ignore(_VINS_OTHERS, "distortion_parameters")
    return camera_file(keys, size, intrinsics, model, coefficients, name=name)
