"""CAMERA.json: reading a camera from a file or by the name of a built-in one."""

from __future__ import annotations

import json
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from simulator.camera.model import Camera, Distortion, camera_problem
from simulator.errors import UserError
from simulator.file_errors import explain

_Size = Annotated[int, Meta(ge=16, le=16384)]
_Focal = Annotated[float, Meta(gt=0, le=1e7)]
_Centre = Annotated[float, Meta(ge=-1e5, le=1e5)]


class DistortionSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Lens distortion: OpenCV's models, coefficients in OpenCV's order."""

    model: Literal["none", "brown_conrady", "kannala_brandt"] = "none"
    coefficients: tuple[float, ...] = ()


class CameraFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The camera object of CAMERA.json; pixel (0, 0) is the centre of the top-left pixel."""

    width_px: _Size
    height_px: _Size
    fx_px: _Focal
    fy_px: _Focal
    cx_px: _Centre
    cy_px: _Centre
    distortion: DistortionSection = DistortionSection()
    name: str = ""
    notes: str = ""

    def camera(self, where: str) -> Camera:
        """The camera model.

        Raises
        ------
        UserError
            If the lens cannot be, for example folds back inside the image; ``where`` names the file.
        """
        camera = Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=self.fx_px,
            fy_px=self.fy_px,
            cx_px=self.cx_px,
            cy_px=self.cy_px,
            distortion=Distortion(self.distortion.model, self.distortion.coefficients),
        )
        problem = camera_problem(camera)
        if problem is not None:
            raise UserError(f"{where}: key {problem}")
        return camera


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
        if not path.is_file():
            raise UserError(_no_such_camera(text))
        content, where = path.read_bytes(), str(path)
    try:
        raw = json.loads(content)
    except ValueError as error:
        raise UserError(f"{where} is not JSON: {error}") from error
    # a truth record holds the camera as one of its objects; its file is accepted as it is
    if isinstance(raw, dict) and isinstance(raw.get("camera"), dict):
        raw = raw["camera"]
    try:
        return msgspec.convert(raw, CameraFile)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {explain(str(error), raw, CameraFile)}") from error


def _no_such_camera(text: str) -> str:
    names = list_cameras()
    near = get_close_matches(text, names, n=3, cutoff=0.5)
    if near:
        return f"there is no camera {text!r}, neither a file nor built in: did you mean {' or '.join(near)}?"
    return f"there is no camera {text!r}, neither a file nor built in: built-in ones are {', '.join(names)}"
