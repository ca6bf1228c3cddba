"""Camera files of others, read and written: SPEED's and SPEED+'s JSON, OpenCV, ROS CameraInfo and Kalibr YAML.

All of them put pixel (0, 0) at the centre of the top-left pixel, as this project does, and order Brown-Conrady
coefficients as OpenCV does (k1 k2 p1 p2 k3 ...).
"""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any

import msgspec

from simulator.camera.lens.files_native import CameraFile
from simulator.errors import UserError
from simulator.runtime.untrusted_files import MOST_DEEP, decode_text, refuse_deep

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import yaml

LARGEST = 10**300
MOST_YAML_BYTES = 1_000_000  # its reader takes ten seconds for as much
FORMATS = ("native", "speed", "opencv", "ros", "kalibr")
SUFFIX = {"native": ".json", "speed": ".json", "opencv": ".yaml", "ros": ".yaml", "kalibr": ".yaml"}
_ROS_MODELS = {
    "plumb_bob": "brown_conrady",
    "rational_polynomial": "brown_conrady",
    "equidistant": "kannala_brandt",
}
_KALIBR_MODELS = {"radtan": "brown_conrady", "equidistant": "kannala_brandt", "none": "none"}
_SPEED_PITCH_UM = 5.86


def read_raw(content: bytes, where: str) -> dict[str, Any]:
    """The table that a JSON or YAML file holds, every number in it finite.

    Raises
    ------
    UserError
        If it is neither, or holds no table.
    """
    text = decode_text(content, where)
    if text.lstrip().startswith(("{", "[")):
        refuse_deep(content, where)
        try:
            raw = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UserError(f"{where} is not JSON: {error}") from error
    else:
        if len(content) > MOST_YAML_BYTES:
            raise UserError(
                f"{where} is YAML of more than {MOST_YAML_BYTES / 1e6:g} MB: give the camera alone"
            )
        import yaml  # noqa: PLC0415 - slow to import: most scenarios' cameras need none

        # OpenCV's writer says %YAML:1.0, which YAML itself does not allow, and tags its matrices
        text = re.sub(r"^%YAML[: ].*$", "", text, flags=re.MULTILINE).replace("!!opencv-matrix", "")
        try:
            raw = yaml.load(text, _plain_loader())  # noqa: S506 - the safe one, with less
        except (
            yaml.YAMLError,
            ValueError,
            OverflowError,
            RecursionError,
        ) as error:  # also of dates and numbers that are none
            place = " ".join(str(error).split())
            raise UserError(f"{where} is not JSON and not YAML: {place}") from error
    if not isinstance(raw, dict):
        raise UserError(f"{where} is not JSON or YAML with a table of keys: give a camera file")
    _check_finite(raw, where, "")
    return raw


def _plain_loader() -> type[yaml.SafeLoader]:
    """YAML without anchors, and no deeper than any camera file."""
    import yaml  # noqa: PLC0415 - as in `read_raw`

    class Loader(yaml.SafeLoader):  # type: ignore[misc] # the library has no types
        depth = 0

        def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
            if self.check_event(yaml.AliasEvent):
                raise yaml.YAMLError("it refers to another place of itself, which a camera file does not")
            self.depth += 1
            if self.depth > MOST_DEEP:
                raise yaml.YAMLError(f"it nests more than {MOST_DEEP} tables in each other")
            try:
                return super().compose_node(parent, index)
            finally:
                self.depth -= 1

    return Loader


def _check_finite(value: Any, where: str, key: str) -> None:  # noqa: ANN401 - a value of JSON is anything
    if isinstance(value, dict):
        for k, v in value.items():
            _check_finite(v, where, f"{key}.{k}" if key else str(k))
    elif isinstance(value, list):
        for v in value:
            _check_finite(v, where, key)
    elif isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{where}: key {key} is {value}, a finite number is needed")
    elif isinstance(value, int) and abs(value) > LARGEST:
        raise UserError(f"{where}: key {key} has {len(str(value))} digits, a number up to 1e300 is needed")


def recognised(raw: dict[str, Any]) -> Callable[[dict[str, Any], str], CameraFile] | None:
    """The reader of a foreign file, or None for one of this project's own."""
    keys = {str(k).lower() for k in raw}
    if "nu" in keys and "nv" in keys:
        return _from_speed
    if "camera_matrix" in raw and "distortion_model" in raw:
        return _from_ros
    if "camera_matrix" in raw:
        return _from_opencv
    if any(isinstance(v, dict) and "intrinsics" in v for v in raw.values()) or "intrinsics" in raw:
        return _from_kalibr
    return None


def _from_speed(raw: dict[str, Any], where: str) -> CameraFile:
    low = {str(k).lower(): v for k, v in raw.items()}
    width, height = _count(low, "nu", where), _count(low, "nv", where)
    matrix = low.get("cameramatrix", low.get("k"))
    if matrix is not None:
        fx, fy, cx, cy = _matrix(matrix, where, "cameraMatrix")
    else:
        pitch = [_number(low, key, where) for key in ("ppx", "ppy")]
        if min(pitch) <= 0:
            raise UserError(
                f"{where}: keys ppx, ppy are {pitch[0]:g} and {pitch[1]:g} m, both must be above 0"
            )
        fx, fy = (_number(low, key, where) / p for key, p in zip(("fx", "fy"), pitch, strict=True))
        middle = {"ccx": width / 2, "ccy": height / 2}
        cx, cy = (_number(middle | low, key, where) for key in middle)
    coefficients = _numbers(low.get("distcoeffs", []), where, "distCoeffs")
    made = _made(where, width, height, (fx, fy, cx, cy), "brown_conrady", coefficients)
    if "ppx" in low and "ppy" in low:
        across, down = (round(_number(low, key, where) * 1e6, 6) for key in ("ppx", "ppy"))
        if min(across, down) > 0:
            made = msgspec.structs.replace(made, pixel_pitch_um=(across, down))
    return made


def _from_opencv(raw: dict[str, Any], where: str) -> CameraFile:
    width, height = _count(raw, "image_width", where), _count(raw, "image_height", where)
    intrinsics = _matrix(raw["camera_matrix"], where, "camera_matrix")
    found = raw.get("distortion_coefficients", raw.get("dist_coeffs", []))
    fisheye = bool(raw.get("fisheye_model", 0))
    model = "kannala_brandt" if fisheye else "brown_conrady"
    return _made(where, width, height, intrinsics, model, _numbers(found, where, "distortion_coefficients"))


def _from_ros(raw: dict[str, Any], where: str) -> CameraFile:
    width, height = _count(raw, "image_width", where), _count(raw, "image_height", where)
    intrinsics = _matrix(raw["camera_matrix"], where, "camera_matrix")
    model = _ROS_MODELS.get(str(raw["distortion_model"]))
    if model is None:
        raise UserError(
            f"{where}: key distortion_model is {raw['distortion_model']!r}, allowed: {', '.join(_ROS_MODELS)}"
        )
    found = _numbers(raw.get("distortion_coefficients", []), where, "distortion_coefficients")
    made = _made(where, width, height, intrinsics, model, found)
    return msgspec.structs.replace(made, name=str(raw.get("camera_name", "")))


def _from_kalibr(raw: dict[str, Any], where: str) -> CameraFile:
    cameras = {k: v for k, v in raw.items() if isinstance(v, dict) and "intrinsics" in v}
    name, table = next(iter(cameras.items())) if cameras else ("", raw)
    kind = str(table.get("camera_model", "pinhole"))
    if kind != "pinhole":
        raise UserError(
            f"{where}: key {name}.camera_model is {kind!r}, allowed: pinhole (radtan or equidistant)"
        )
    model = _KALIBR_MODELS.get(str(table.get("distortion_model", "none")))
    if model is None:
        allowed = ", ".join(_KALIBR_MODELS)
        raise UserError(
            f"{where}: key {name}.distortion_model is {table['distortion_model']!r}, allowed: {allowed}"
        )
    size = _numbers(table.get("resolution", []), where, f"{name}.resolution")
    intrinsics = _numbers(table["intrinsics"], where, f"{name}.intrinsics")
    if len(size) != 2 or len(intrinsics) != 4:
        raise UserError(f"{where}: {name} needs resolution [width, height] and intrinsics [fx, fy, cx, cy]")
    coefficients = _numbers(table.get("distortion_coeffs", []), where, f"{name}.distortion_coeffs")
    table = dict(zip(("resolution[0]", "resolution[1]"), size, strict=True))
    width, height = (_count(table, key, where) for key in table)
    made = _made(where, width, height, intrinsics, model, coefficients)
    return msgspec.structs.replace(made, name=name)


def _made(
    where: str,
    width: int,
    height: int,
    intrinsics: Iterable[float],
    model: str,
    coefficients: list[float],
) -> CameraFile:
    fx, fy, cx, cy = (float(v) for v in intrinsics)
    if not any(coefficients):
        model, coefficients = "none", []
    if model == "brown_conrady" and len(coefficients) > 8:
        if any(coefficients[8:]):
            raise UserError(
                f"{where}: thin prism and tilt terms of the distortion are not drawn; calibrate without them"
            )
        coefficients = coefficients[:8]
    table = {
        "width_px": width,
        "height_px": height,
        "fx_px": fx,
        "fy_px": fy,
        "cx_px": cx,
        "cy_px": cy,
        "distortion": {"model": model, "coefficients": coefficients},
    }
    if fx <= 0 or fy <= 0:
        raise UserError(
            f"{where}: the camera matrix is singular: its focal lengths are {fx:g} and {fy:g} px, both must be above 0"
        )
    try:
        return msgspec.convert(table, CameraFile)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {error}") from error


def _number(table: dict[str, Any], key: str, where: str) -> float:
    value = table.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise UserError(f"{where}: key {key} is {value!r}, a number is needed")
    return float(value)


def _count(table: dict[str, Any], key: str, where: str) -> int:
    value = _number(table, key, where)
    if value != int(value):
        raise UserError(f"{where}: key {key} is {value:g}, a whole number of pixels is needed")
    return int(value)


def _numbers(value: Any, where: str, key: str) -> list[float]:  # noqa: ANN401 - a value of YAML is anything
    """A list of numbers, nested or as OpenCV's matrix."""
    if isinstance(value, dict):
        value = value.get("data", [])
    flat: list[float] = []
    for v in value if isinstance(value, list) else [value]:
        if isinstance(v, list):
            flat += _numbers(v, where, key)
        elif isinstance(v, int | float) and not isinstance(v, bool):
            flat.append(float(v))
        else:
            raise UserError(f"{where}: key {key} holds {v!r}, numbers are needed")
    return flat


def _matrix(value: Any, where: str, key: str) -> tuple[float, float, float, float]:  # noqa: ANN401
    m = _numbers(value, where, key)
    if len(m) != 9:
        raise UserError(f"{where}: key {key} has {len(m)} numbers, a 3 x 3 matrix is needed")
    if abs(m[1]) > 1e-9 * abs(m[0]):
        raise UserError(f"{where}: key {key} has a skew of {m[1]:g} px, which is not drawn; it must be 0")
    if abs(m[8] - 1) > 1e-9 or any(abs(v) > 1e-12 for v in (m[3], m[6], m[7])):
        raise UserError(f"{where}: key {key} is no camera matrix: its last row must be 0 0 1")
    return m[0], m[4], m[2], m[5]


def written(camera: CameraFile, form: str, where: str) -> str:
    """Text of a camera in one of `FORMATS`.

    Raises
    ------
    UserError
        If the format has no such lens.
    """
    c, d = camera, camera.distortion
    K = [c.fx_px, 0.0, c.cx_px, 0.0, c.fy_px, c.cy_px, 0.0, 0.0, 1.0]
    fisheye = d.model == "kannala_brandt"
    coefficients = list(d.coefficients)
    if form == "native":
        known = {k: v for k, v in msgspec.to_builtins(c).items() if v is not None}
        return msgspec.json.format(msgspec.json.encode(known), indent=1).decode() + "\n"
    if form == "speed":
        if fisheye:
            raise UserError(f"{where}: SPEED's camera file has no fisheye lens; write opencv, ros or kalibr")
        across, down = (p * 1e-6 for p in c.pixel_pitch_um or (_SPEED_PITCH_UM, _SPEED_PITCH_UM))
        table = {
            "Nu": c.width_px,
            "Nv": c.height_px,
            "ppx": across,
            "ppy": down,
            "fx": c.fx_px * across,
            "fy": c.fy_px * down,
            "ccx": c.cx_px,
            "ccy": c.cy_px,
            "cameraMatrix": [K[:3], K[3:6], K[6:]],
            "distCoeffs": coefficients or [0.0] * 5,
        }
        return json.dumps(table, indent=1) + "\n"
    if form == "opencv":
        padded = coefficients or [0.0] * 5
        return (
            "%YAML:1.0\n---\n"
            f"image_width: {c.width_px}\nimage_height: {c.height_px}\n"
            + (f"fisheye_model: {int(fisheye)}\n" if fisheye else "")
            + _opencv_matrix("camera_matrix", 3, 3, K)
            + _opencv_matrix("distortion_coefficients", len(padded), 1, padded)
        )
    if form == "ros":
        name = "equidistant" if fisheye else "rational_polynomial" if len(coefficients) == 8 else "plumb_bob"
        padded = coefficients + [0.0] * (5 - len(coefficients) if name == "plumb_bob" else 0)
        table = {
            "image_width": c.width_px,
            "image_height": c.height_px,
            "camera_name": c.name or "camera",
            "camera_matrix": {"rows": 3, "cols": 3, "data": K},
            "distortion_model": name,
            "distortion_coefficients": {"rows": 1, "cols": len(padded), "data": padded},
            "rectification_matrix": {"rows": 3, "cols": 3, "data": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]},
            "projection_matrix": {"rows": 3, "cols": 4, "data": [*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0]},
        }
        return _as_yaml(table)
    if form != "kalibr":
        raise UserError(f"there is no camera format {form!r}: choose one of {', '.join(FORMATS)}")
    if len(coefficients) > 4 and any(coefficients[4:]):
        raise UserError(
            f"{where}: Kalibr's radtan lens has k1 k2 p1 p2 only, this one has {len(coefficients)} coefficients; write "
            "opencv or ros"
        )
    table = {
        "cam0": {
            "camera_model": "pinhole",
            "intrinsics": [c.fx_px, c.fy_px, c.cx_px, c.cy_px],
            "distortion_model": "equidistant" if fisheye else "radtan",
            "distortion_coeffs": (coefficients or [0.0] * 4)[:4],
            "resolution": [c.width_px, c.height_px],
        }
    }
    return _as_yaml(table)


def _as_yaml(table: dict[str, Any]) -> str:
    import yaml  # noqa: PLC0415 - as above

    return str(yaml.safe_dump(table, sort_keys=False, default_flow_style=None, width=1000))


def _opencv_matrix(name: str, rows: int, columns: int, data: list[float]) -> str:
    values = ", ".join(repr(float(v)) for v in data)
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {values} ]\n"
