"""CAMERA.json, a data sheet, and the records and cards that hold a camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.camera.lens.files_native import CameraFile
from flyaround.simulator.camera.lens.intrinsics import LensFile
from flyaround.simulator.runtime.validation_errors import convert_document

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.formats.document import Document

# keys of a lens by its data sheet
_DATA_SHEET = {"focal_length_mm", "pixel_pitch_um", "sensor_size_mm", "aperture_angle_deg"}
# keys by which a file is recognised: those that other formats have, too, are left out
_FIELDS = {*CameraFile.__struct_fields__, *LensFile.__struct_fields__} - {"name", "notes", "distortion"}


def is_native(document: Document) -> bool:
    """Return True for a file of this project: a camera, or a record or card that holds one."""
    return bool(_FIELDS & document.table.keys()) or _holds_camera(document)


def _holds_camera(document: Document) -> bool:
    # a table with nothing but a camera is a part of a record
    ours = str(document.table.get("schema", "")).startswith("flyaround.") or len(document.table) == 1
    return ours and isinstance(document.table.get("camera"), dict)


def read_native(document: Document, source: str) -> CameraFile:
    """Read CAMERA.json, a data sheet, or the camera of a truth record or card.

    Raises
    ------
    UserError
        If a key is wrong; the message states the allowed values.
    """
    raw = document.table["camera"] if _holds_camera(document) else document.table
    # a camera's file may have the pixel pitch of a data sheet, but a data sheet has no focal length in pixels
    kind: type[CameraFile | LensFile] = (
        LensFile if _DATA_SHEET.intersection(raw) and "fx_px" not in raw else CameraFile
    )
    camera = convert_document(raw, kind, source)
    return camera.solve(source) if isinstance(camera, LensFile) else camera


def write_native(camera: CameraFile, source: str) -> str:  # noqa: ARG001 - a writer's signature
    """Return the text of CAMERA.json."""
    fields = {k: v for k, v in msgspec.to_builtins(camera).items() if v is not None}
    return msgspec.json.format(msgspec.json.encode(fields), indent=1).decode() + "\n"
