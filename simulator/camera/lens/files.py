"""Reading a camera from a file of any known format, or by the name of a built-in one."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import msgspec

from simulator.camera.lens.camera_model import Camera
from simulator.camera.lens.files_foreign import read_raw, recognised
from simulator.camera.lens.files_native import CameraFile, DistortionSection
from simulator.camera.lens.intrinsics import LensFile
from simulator.errors import UserError, near_names
from simulator.runtime.untrusted_files import read_regular
from simulator.runtime.validation_errors import explain

__all__ = [
    "CameraFile",
    "DistortionSection",
    "list_cameras",
    "load_camera",
    "parse_camera",
    "read_camera_file",
]
MOST_BYTES = 4_000_000  # of a camera file: a calibration may have its points with it
_DATA_SHEET = {"focal_length_mm", "pixel_pitch_um", "sensor_size_mm", "aperture_angle_deg"}


def list_cameras() -> tuple[str, ...]:
    """Names of the built-in cameras."""
    folder = files("assets").joinpath("cameras")
    return tuple(sorted(f.name.removesuffix(".json") for f in folder.iterdir() if f.name.endswith(".json")))


def load_camera(name_or_path: str | Path) -> Camera:
    """A camera from the name of a built-in one or from a CAMERA.json.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake.
    """
    return read_camera_file(name_or_path).camera(str(name_or_path))


def read_camera_file(name_or_path: str | Path, folder: Path | None = None) -> CameraFile:
    """The camera as its file has it, with name and notes; a relative path is looked for in ``folder``.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake.
    """
    text = str(name_or_path)
    if text in list_cameras():
        content = files("assets").joinpath("cameras", f"{text}.json").read_bytes()
        where = f"built-in camera {text}"
    else:
        path = (folder or Path()) / name_or_path
        try:
            if not path.is_file():
                raise UserError(_no_such_camera(text))
            content, where = read_regular(path, MOST_BYTES), str(path)
        except OSError as error:
            raise UserError(
                f"camera {path} cannot be read: {error.strerror or error}; check the path"
            ) from error
    return parse_camera(content, where)


def parse_camera(content: bytes, where: str) -> CameraFile:
    """A camera from the text of a file: CAMERA.json, a data sheet's keys, SPEED's JSON, OpenCV, ROS or Kalibr YAML.

    Raises
    ------
    UserError
        If the text is none of these or has a mistake; ``where`` names the file.
    """
    raw = read_raw(content, where)
    # a truth record holds the camera as one of its objects; its file is accepted as it is
    if isinstance(raw.get("camera"), dict):
        raw = raw["camera"]
    foreign = recognised(raw)
    if foreign is not None:
        return foreign(raw, where)
    kind: type[CameraFile | LensFile] = (
        LensFile if _DATA_SHEET.intersection(raw) and "fx_px" not in raw else CameraFile
    )
    try:
        found = msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {explain(str(error), raw, kind)}") from error
    return found.solved(where) if isinstance(found, LensFile) else found


def _no_such_camera(text: str) -> str:
    names = list_cameras()
    near = near_names(text, names, 3)
    if near:
        return f"there is no camera {text!r}, neither a file nor built in: did you mean {' or '.join(near)}?"
    return f"there is no camera {text!r}, neither a file nor built in: built-in ones are {', '.join(names)}"
