"""Reader of cameras: from a file of any known format, or by the name of a built-in one."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.camera.lens.files_native import CameraFile, DistortionSection
from flyaround.simulator.camera.lens.formats.document import parse_document
from flyaround.simulator.camera.lens.formats.registry import read_camera_document
from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.untrusted_files import read_regular

__all__ = [
    "CameraFile",
    "DistortionSection",
    "list_cameras",
    "load_camera",
    "parse_camera",
    "read_camera_file",
]
MAX_BYTES = 4_000_000  # largest camera file: a calibration may include its points


def list_cameras() -> tuple[str, ...]:
    """Return the names of the built-in cameras.

    Returns
    -------
    tuple of str
        Names that `load_camera` accepts.
    """
    folder = files("flyaround.assets").joinpath("cameras")
    return tuple(sorted(f.name.removesuffix(".json") for f in folder.iterdir() if f.name.endswith(".json")))


def load_camera(name_or_path: str | Path) -> Camera:
    """Load a camera by the name of a built-in one or from a camera file.

    Returns
    -------
    Camera
        Intrinsics, lens and encoding of the images.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake.
    """
    return read_camera_file(name_or_path).camera(str(name_or_path))


def read_camera_file(name_or_path: str | Path, folder: Path | None = None) -> CameraFile:
    """Read a camera file with name and notes; a relative path is looked up in ``folder``.

    Returns
    -------
    CameraFile
        Content of the file as the native format has it; `CameraFile.camera` makes the camera model.

    Raises
    ------
    UserError
        If there is none, or the file has a mistake.
    """
    text = str(name_or_path)
    if text in list_cameras():
        content = files("flyaround.assets").joinpath("cameras", f"{text}.json").read_bytes()
        source = f"built-in camera {text}"
    else:
        path = (folder or Path()) / name_or_path
        try:
            if not path.is_file():
                raise UserError(_no_such_camera(text))
            content, source = read_regular(path, MAX_BYTES), str(path)
        except OSError as error:
            raise UserError(
                f"camera {path} cannot be read: {error.strerror or error}; check the path"
            ) from error
    return parse_camera(content, source)


def parse_camera(content: bytes, source: str) -> CameraFile:
    """Read a camera from the text of a file in any of `CAMERA_FORMATS`.

    Returns
    -------
    CameraFile
        Content of the file as the native format has it; `CameraFile.camera` makes the camera model.

    Raises
    ------
    UserError
        If it is in none of these formats or has a mistake; ``source`` names the file.
    """
    return read_camera_document(parse_document(content, source), source)


def _no_such_camera(text: str) -> str:
    names = list_cameras()
    suggestions = near_names(text, names, 3)
    if suggestions:
        return f"there is no camera {text!r}, neither a file nor built in: did you mean {' or '.join(suggestions)}?"
    return f"there is no camera {text!r}, neither a file nor built in: built-in ones are {', '.join(names)}"
