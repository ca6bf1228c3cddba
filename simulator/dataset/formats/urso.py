"""URSO: ``N_rgb.png``, ``SPLIT_images.csv`` and ``SPLIT_poses_gt.csv`` (x, y, z, q1 to q4, the scalar last).

URSO's camera axes are left-handed: x forward, y right, z up. A position (x, y, z) in OpenCV's axes is (z, x, -y) in
URSO's. The target frame is left-handed too, with y negated, so a rotation R becomes P R diag(1, -1, 1), where P
converts the camera axes.

References
----------
Proenca and Gao (2020), Deep Learning for Spacecraft Pose Estimation from Photorealistic Rendering; the loader of its
authors, github.com/pedropro/UrsoNet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter, lens_problem
from flyaround.simulator.dataset.formats.posed_pictures import (
    PosedPicture,
    PosedPictures,
    checked_pose,
    find_camera,
    find_picture,
    read_csv,
)
from flyaround.simulator.dataset.formats.speed_writer import json_bytes, speed_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.table_text import table_bytes
from flyaround.simulator.runtime.untrusted_files import decode_text, read_regular, refuse_link_out
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.runtime.arrays import FloatArray

# Conversions of the axes; see the module's docstring.
URSO_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
MIRROR = np.diag([1.0, -1.0, 1.0])
FOLDERS = {"": "train", "train": "train", "validation": "val", "test": "test"}
COLUMNS = ("x", "y", "z", "q1", "q2", "q3", "q4")

# Maximum size of a list of labels [bytes].
MAX_BYTES = 100_000_000


def urso_pose(q_wxyz: tuple[float, ...], t_m: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Convert a pose to URSO's position (3,) and quaternion (4,), scalar last."""
    w, x, y, z = quat_from_matrix(URSO_FROM_CAMERA @ matrix_from_quat(q_wxyz) @ MIRROR)
    return URSO_FROM_CAMERA @ np.asarray(t_m), np.array([x, y, z, w])


class UrsoWriter:
    """Writer of data sets in the URSO format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        self._rows: dict[str, list[tuple[str, list[str]]]] = {}

    def write(self, frame: LabelledFrame) -> None:
        """Write the image, and collect its row for the CSV files that `finish` writes."""
        name = f"{frame.number}_rgb.png"
        self._output.write(name, frame.read("png"))
        t, q = urso_pose(frame.truth.q_camera_from_target_wxyz, frame.truth.t_camera_from_target_m)
        row = [repr(float(v)) for v in (*t, *q)]
        self._rows.setdefault(FOLDERS[frame.split], []).append((name, row))

    def finish(self) -> None:
        """Write the CSV files and the camera, which is an addition: the authors' loader has it in its code."""
        for split, rows in self._rows.items():
            self._output.write(f"{split}_images.csv", "".join(f"{name}\n" for name, _ in rows).encode())
            poses = table_bytes(COLUMNS, rows=(row for _, row in rows))
            self._output.write(f"{split}_poses_gt.csv", poses)
        self._output.write("camera.json", json_bytes(speed_camera(self._card.camera)))


def read_urso(place: Path) -> PosedPictures | None:
    """Read a folder in the URSO format, or one of its ``SPLIT_poses_gt.csv``; return None for another format.

    Raises
    ------
    UserError
        If the folder has several splits, poses and images differ in number, or a row is invalid.
    """
    if place.is_file():
        lists = [place] if place.name.endswith("_poses_gt.csv") else []
    else:
        lists = sorted(place.glob("*_poses_gt.csv"))
    if not lists:
        return None
    if len(lists) > 1:
        raise UserError(f"{place} holds several sets ({', '.join(map(str, lists))}); give one of these lists")
    labels = lists[0]
    rows = read_csv(labels, COLUMNS)
    images = labels.with_name(labels.name.replace("_poses_gt", "_images"))
    refuse_link_out(images, labels.parent)
    try:
        names = decode_text(read_regular(images, MAX_BYTES), str(images)).split()
    except OSError as error:
        raise UserError(
            f"cannot read {images}, the names of the pictures: {error}; check the data set"
        ) from error
    if len(names) != len(rows):
        raise UserError(
            f"{labels} has {len(rows)} poses and {images.name} {len(names)} pictures; check the data set"
        )
    pictures = []
    for k, (name, row) in enumerate(zip(names, rows, strict=True)):
        source = f"{labels} line {k + 2}"
        urso_frame = checked_pose(
            [row["q4"], row["q1"], row["q2"], row["q3"]], [row["y"], row["z"], row["x"]], source
        )
        R = URSO_FROM_CAMERA.T @ urso_frame.R @ MIRROR
        t = (urso_frame.t_m[0], -urso_frame.t_m[1], urso_frame.t_m[2])
        pose = checked_pose(quat_from_matrix(R), t, source)
        pictures.append(PosedPicture(name, find_picture(labels, [labels.parent], name), pose))
    return PosedPictures(labels, tuple(pictures), find_camera(labels.parent, levels=0), encoding="srgb")


def _urso(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return UrsoWriter(output, card)


URSO = DatasetFormat(
    name="urso",
    title="URSO (Surrey)",
    carries="image and pose, in left-handed axes with the model mirrored",
    lacks="masks, boxes, keypoints and layers",
    writer=_urso,
    read=read_urso,
    problem=lens_problem,
)
