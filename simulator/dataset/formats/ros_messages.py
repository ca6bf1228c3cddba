"""Images, cameras and poses as ROS 2 messages: definitions and field values.

Poses are those of the target in the camera's optical frame (x right, y down, z forward: REP 103's ``_optical``); the
target's axes are those of its model. Quaternions are x, y, z, w, as in ROS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import Quat, Vec3

CAMERA_FRAME, TARGET_FRAME = "camera_optical", "target"

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_PARTS = {"builtin_interfaces/Time": _TIME, "std_msgs/Header": _HEADER}


def ros_definition(fields: str, **parts: str) -> str:
    """Compose a message's definition as rosbag2 stores it.

    Returns
    -------
    str
        ``fields``, then the definitions of ``parts``, of Time and of Header; ``__`` in a keyword stands for ``/``.
    """
    definitions = {name.replace("__", "/"): text for name, text in parts.items()} | _PARTS
    rule = "=" * 80
    return fields + "".join(f"{rule}\nMSG: {name}\n{text}" for name, text in definitions.items())


DEFINITIONS = {
    "sensor_msgs/msg/Image": ros_definition(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data\n"
    ),
    "sensor_msgs/msg/CameraInfo": ros_definition(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
        sensor_msgs__RegionOfInterest="uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\n"
        "bool do_rectify\n",
    ),
    "geometry_msgs/msg/PoseStamped": ros_definition(
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        geometry_msgs__Pose="geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        geometry_msgs__Point=_POINT,
        geometry_msgs__Quaternion=_QUATERNION,
    ),
    "tf2_msgs/msg/TFMessage": ros_definition(
        "geometry_msgs/TransformStamped[] transforms\n",
        geometry_msgs__TransformStamped="std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/Transform transform\n",
        geometry_msgs__Transform="geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        geometry_msgs__Vector3=_POINT,
        geometry_msgs__Quaternion=_QUATERNION,
    ),
    "sensor_msgs/msg/CompressedImage": ros_definition(
        "std_msgs/Header header\nstring format\nuint8[] data\n"
    ),
    "std_msgs/msg/String": "string data\n",
}
"""Text of each message type, by name."""

DISTORTION_MODELS = {
    "none": "plumb_bob",
    "brown_conrady": "rational_polynomial",
    "kannala_brandt": "equidistant",
}
MIN_COEFFICIENTS = {"none": 5, "brown_conrady": 8, "kannala_brandt": 4}


def header(epoch_utc: str, frame_id: str = CAMERA_FRAME) -> dict[str, Any]:
    """Compose a std_msgs/Header at a time in UTC.

    Returns
    -------
    dict
        Field values: ``stamp`` since 1970, and ``frame_id``.
    """
    sec, nanosec = divmod(nanoseconds_utc(epoch_utc), 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}


def image(pixels: NDArray[np.unsignedinteger], epoch_utc: str) -> dict[str, Any]:
    """Compose a sensor_msgs/Image of digital numbers.

    Returns
    -------
    dict
        Field values with the encoding mono8, mono16, rgb8 or rgb16; the data are a little-endian copy of the pixels.
    """
    pixels = pixels.astype(pixels.dtype.newbyteorder("<"), copy=False)
    height, width = pixels.shape[:2]
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    kind = {1: "mono", 3: "rgb"}[channels]
    return {
        "header": header(epoch_utc),
        "height": height,
        "width": width,
        "encoding": f"{kind}{8 * pixels.itemsize}",
        "is_bigendian": 0,
        "step": width * channels * pixels.itemsize,
        "data": np.ascontiguousarray(pixels).tobytes(),
    }


def camera_info(camera: Camera, epoch_utc: str) -> dict[str, Any]:
    """Compose a sensor_msgs/CameraInfo of an unrectified image.

    Returns
    -------
    dict
        Field values: ``d`` in OpenCV's order, padded with zeros to the model's least number of coefficients.
    """
    model = camera.distortion.model
    d = [float(x) for x in camera.distortion.coefficients]
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return {
        "header": header(epoch_utc),
        "height": camera.height_px,
        "width": camera.width_px,
        "distortion_model": DISTORTION_MODELS[model],
        "d": d + [0.0] * (MIN_COEFFICIENTS[model] - len(d)),
        "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def _xyz(v: Vec3) -> dict[str, float]:
    return {"x": float(v[0]), "y": float(v[1]), "z": float(v[2])}


def _xyzw(q_wxyz: Quat) -> dict[str, float]:
    w, x, y, z = (float(c) for c in q_wxyz)
    return {"x": x, "y": y, "z": z, "w": w}


def pose_stamped(
    q_camera_from_target_wxyz: Quat, t_camera_from_target_m: Vec3, epoch_utc: str
) -> dict[str, Any]:
    """Compose a geometry_msgs/PoseStamped of the target in the camera.

    Returns
    -------
    dict
        Field values, in `CAMERA_FRAME`: position [m], and orientation as x, y, z, w.
    """
    return {
        "header": header(epoch_utc),
        "pose": {"position": _xyz(t_camera_from_target_m), "orientation": _xyzw(q_camera_from_target_wxyz)},
    }


def transform(
    q_camera_from_target_wxyz: Quat, t_camera_from_target_m: Vec3, epoch_utc: str, child: str
) -> dict[str, Any]:
    """Compose a tf2_msgs/TFMessage with one transform, from ``child`` to the camera.

    Returns
    -------
    dict
        Field values: one transform from ``child`` to `CAMERA_FRAME`, with translation [m] and rotation as x, y, z, w.
    """
    return {
        "transforms": [
            {
                "header": header(epoch_utc),
                "child_frame_id": child,
                "transform": {
                    "translation": _xyz(t_camera_from_target_m),
                    "rotation": _xyzw(q_camera_from_target_wxyz),
                },
            }
        ]
    }
