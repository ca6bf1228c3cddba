"""Images with poses from foreign data sets: the common result of all readers, and helpers for text files."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flyaround.simulator.camera.lens.files import parse_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import (
    decode_text,
    find_beside,
    read_regular,
    refuse_deep,
    refuse_link_out,
)
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.camera.encoding import Encoding
    from flyaround.simulator.camera.lens.camera_model import Camera

MAX_BYTES = 500_000_000  # size limit of a list of labels, for a million images

# Maximum size of a camera file [bytes].
MAX_CAMERA_BYTES = 4_000_000

# Plausible range of a target [m].
MIN_RANGE_M, MAX_RANGE_M = 0.01, 1e6
UNIT_TOLERANCE = 1e-3  # published quaternions are rounded, some to four digits


@dataclass(frozen=True, eq=False)
class PosedPicture:
    """One image and the pose of the target in its camera.

    Parameters
    ----------
    name : str
        Name in the set's own list.
    path : Path
        Image file.
    camera_from_target : Pose
        Pose of the target in the camera frame.
    t_s : float, optional
        Time since the first image of a sequence [s].
    """

    name: str
    path: Path
    camera_from_target: Pose
    t_s: float = 0.0


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """The images of a foreign data set.

    Parameters
    ----------
    labels : Path
        Path of the list.
    pictures : tuple of PosedPicture
        The images, in the list's order.
    camera : Camera or None
        Camera of the data set; None if it has no camera file.
    default_camera : str, optional
        Built-in camera of data sets in this format; empty if they vary.
    default_target : str, optional
        Built-in target of data sets in this format; empty if they vary.
    encoding : Encoding, optional
        Transfer function of the images of a set without a camera file.
    """

    labels: Path
    pictures: tuple[PosedPicture, ...]
    camera: Camera | None
    default_camera: str = ""
    default_target: str = ""
    encoding: Encoding = "linear"


def read_json(path: Path, *, max_bytes: int = MAX_BYTES) -> Any:  # noqa: ANN401 - any JSON value
    """Read a foreign JSON file.

    Returns
    -------
    object
        Value as `json.loads` makes it, of a structure that is not checked.

    Raises
    ------
    UserError
        If it cannot be read, is a link out of its folder, too long, too deep, or not JSON.
    """
    refuse_link_out(path, path.parent)
    try:
        data = read_regular(path, max_bytes)
        refuse_deep(data, str(path))
        return json.loads(data)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror or error}; check the data set") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path} is not JSON: {error}; check the data set") from error


def read_csv(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Read the rows of a foreign CSV file with a header line, stripping blanks.

    Raises
    ------
    UserError
        If it cannot be read, is a link out of its folder, or lacks one of the columns.
    """
    refuse_link_out(path, path.parent)
    try:
        text = decode_text(read_regular(path, MAX_BYTES), str(path))
        reader = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
        rows = [
            {(name or "").strip(): (cell or "").strip() for name, cell in row.items() if name is not None}
            for row in reader
        ]
        header = [name.strip() for name in reader.fieldnames or ()]
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror or error}; check the data set") from error
    except csv.Error as error:
        raise UserError(f"{path} is not a CSV file: {error}; check the data set") from error
    missing = [name for name in columns if name not in header]
    if missing:
        raise UserError(f"{path} lacks the column {missing[0]}; its first line must name {','.join(columns)}")
    return rows


def find_camera(folder: Path, levels: int = 2) -> Camera | None:
    """Return the camera of the nearest ``camera.json``, in a folder or some levels above it; None if there is none.

    Raises
    ------
    UserError
        If the file has a mistake.
    """
    for candidate in (folder, *folder.resolve().parents[:levels]):
        path = candidate / "camera.json"
        if path.is_file():
            refuse_link_out(path, candidate)
            content = read_regular(path, MAX_CAMERA_BYTES)
            return parse_camera(content, str(path)).camera(str(path))
    return None


def find_picture(labels: Path, places: Iterable[Path], name: Any) -> Path:  # noqa: ANN401 - a cell of a file
    """Return the path of an image that a list names.

    Parameters
    ----------
    labels : Path
        Path of the list.
    places : iterable of Path
        Folders to search, in order.
    name : object
        Name of the image in the list.

    Raises
    ------
    UserError
        If no folder has the image, or the name or a symbolic link points outside the list's folder.
    """
    if not isinstance(name, str) or not name:
        raise UserError(f"{labels} names a picture {name!r}; a file name is needed")
    searched = []
    for candidate in places:
        path = find_beside(candidate / labels.name, name, "picture")
        if path.is_file():
            refuse_link_out(path, labels.parent)
            return path
        searched.append(str(candidate))
    raise UserError(
        f"{labels} names {name}, which is not in {' or '.join(searched)}; give the whole data set"
    )


def checked_pose(q_wxyz: Any, t_m: Any, source: str) -> Pose:  # noqa: ANN401 - values of a file
    """Return the target's pose in the camera from values of a foreign file.

    Returns
    -------
    Pose
        Camera-from-target pose [m].

    Raises
    ------
    UserError
        If these are not four and three finite numbers, the quaternion is not of unit length, or the target is behind
        the camera; the message starts with ``source``.
    """
    numbers = []
    for quantity, values, count in (("quaternion", q_wxyz, 4), ("position", t_m, 3)):
        try:
            row = [float(v) for v in values]
        except (TypeError, ValueError, OverflowError):
            row = []
        if len(row) != count or not all(math.isfinite(v) for v in row):
            raise UserError(f"{source}: the {quantity} is {str(values)[:80]}, give {count} finite numbers")
        numbers.append(row)
    q, t = numbers
    if abs(math.hypot(*q) - 1) > UNIT_TOLERANCE:
        raise UserError(f"{source}: the quaternion's length is {math.hypot(*q):g}; it must be one")
    if not (t[2] > 0 and MIN_RANGE_M < math.hypot(*t) < MAX_RANGE_M):
        raise UserError(
            f"{source}: the target is at {t} m, which is not in front of the camera or not {MIN_RANGE_M:g} to "
            f"{MAX_RANGE_M:g} m away; the data set may use other axes"
        )
    return Pose.from_arrays("camera", "target", q, t)
