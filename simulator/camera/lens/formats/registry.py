"""Registry of camera file formats: how each is recognised, read and written.

To add a format, write a module with functions that recognise, read and optionally write it, and add an entry to
`CAMERA_FORMATS`.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec import UNSET

from flyaround.simulator.camera.lens.formats import (
    kalibr,
    matlab,
    native,
    opencv,
    reconstruction,
    slam,
    speed,
)
from flyaround.simulator.errors import UserError, near_names

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

log = logging.getLogger(__name__)

__all__ = ["CAMERA_FORMATS", "WRITABLE_FORMATS", "CameraFormat", "camera_text", "read_camera_document"]


@dataclass(frozen=True)
class CameraFormat:
    """A format of camera files.

    Parameters
    ----------
    name : str
        Name on the command line.
    title : str
        Name of its files for users.
    recognises : callable
        Returns True for a document in this format.
    read : callable
        Converts a document and the name of its file to a camera; raises for an unknown key.
    write : callable or None
        Converts a camera and its name to text; None if the format is read-only.
    """

    name: str
    title: str
    recognises: Callable[[Document], bool]
    read: Callable[[Document, str], CameraFile]
    write: Callable[[CameraFile, str], str] | None = None


CAMERA_FORMATS = (
    CameraFormat("speed", "SPEED's camera.json", speed.is_speed, speed.read_speed, speed.write_speed),
    CameraFormat(
        "native", "CAMERA.json or a data sheet", native.is_native, native.read_native, native.write_native
    ),
    CameraFormat("matlab", "MATLAB cameraParameters as JSON", matlab.is_matlab, matlab.read_matlab),
    CameraFormat("basalt", "Basalt calibration.json", kalibr.is_basalt, kalibr.read_basalt),
    CameraFormat(
        "kalibr",
        "Kalibr camchain or EuRoC sensor.yaml",
        kalibr.is_kalibr,
        kalibr.read_kalibr,
        kalibr.write_kalibr,
    ),
    CameraFormat("vins", "VINS YAML", slam.is_vins, slam.read_vins),
    CameraFormat("orb-slam", "ORB-SLAM or stella_vslam YAML", slam.is_orb, slam.read_orb),
    CameraFormat("colmap", "COLMAP cameras.txt", reconstruction.is_colmap, reconstruction.read_colmap),
    CameraFormat("nerf", "NeRF transforms.json", reconstruction.is_nerf, reconstruction.read_nerf),
    CameraFormat("bop", "BOP camera.json", reconstruction.is_bop, reconstruction.read_bop),
    CameraFormat(
        "ros", "ROS camera_info YAML, INI or topic echo", opencv.is_ros, opencv.read_ros, opencv.write_ros
    ),
    CameraFormat(
        "opencv", "OpenCV YAML, XML or JSON", opencv.is_opencv, opencv.read_opencv, opencv.write_opencv
    ),
)
"""All formats, the most specific first: the first that recognises a document reads it."""
WITH_ENCODING = ("native", "speed")
"""Formats that state the transfer function of the images."""
WRITABLE_FORMATS = tuple(form.name for form in CAMERA_FORMATS if form.write is not None)


def read_camera_document(document: Document, source: str) -> CameraFile:
    """Read a camera in any known format.

    Raises
    ------
    UserError
        If the format is unknown, or its reader raises.
    """
    form = next((form for form in CAMERA_FORMATS if form.recognises(document)), None)
    if form is None:
        raise UserError(f"{source} {_unrecognised(document)}")
    if document.several and form.name != "ros":
        raise UserError(f"{source} holds several YAML documents; keep the one of the camera")
    camera = form.read(document, source)
    # notes of a reader say what it left out; those of our own files are the user's
    if camera.notes and form.name != "native":
        log.warning("%s: %s", source, camera.notes)
    return camera


def _unrecognised(document: Document) -> str:
    keys = ", ".join(str(key)[:40] for key in list(document.table)[:5])
    titles = ", ".join(form.title for form in CAMERA_FORMATS)
    return f"is none of the camera files that are read (its keys are {keys or 'none'}): give {titles}"


def camera_text(camera: CameraFile, form: str, source: str) -> str:
    """Return a camera as text of a format.

    Returns
    -------
    str
        Content of a file in that format.

    Raises
    ------
    UserError
        If there is no such format, it is read-only, or it cannot express the lens or the encoding.
    """
    writers = {entry.name: entry.write for entry in CAMERA_FORMATS if entry.write is not None}
    if form not in writers:
        suggestions = near_names(form, WRITABLE_FORMATS)
        hint = f"did you mean {suggestions[0]}? " if suggestions else ""
        raise UserError(
            f"there is no camera format {form!r} to write: {hint}choose one of {', '.join(WRITABLE_FORMATS)}"
        )
    if camera.encoding is not UNSET and camera.encoding != "linear" and form not in WITH_ENCODING:
        raise UserError(
            f"{source}: {form} files do not say that images are {camera.encoding}-encoded; "
            f"write {', '.join(WITH_ENCODING)}"
        )
    return writers[form](camera, source)
