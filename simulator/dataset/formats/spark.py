"""SPARK: ``SPLIT.csv`` of file names, positions and quaternions with the scalar last, images in ``images/SPLIT/``.

Columns ``sequence filename Tx Ty Tz Qx Qy Qz Qw`` as in SPARK 2022's second stream: the pose of the craft in the
camera, x right, y down, z forward. ``camera.json`` is in SPEED+'s form.

References
----------
Rathinam et al. (2022), SPARK 2022: Dataset for Spacecraft Detection and Trajectory Estimation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.dataset.formats.base import (
    DatasetFormat,
    FormatOutput,
    FormatWriter,
    fisheye_problem,
)
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

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.scene.state import SceneState

COLUMNS = ("filename", "Tx", "Ty", "Tz", "Qx", "Qy", "Qz", "Qw")
FOLDERS = {"": "train", "train": "train", "validation": "val", "test": "test"}


class SparkWriter:
    """Writer of data sets in the SPARK format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        self._rows: dict[str, list[list[str]]] = {}

    def write(self, frame: LabelledFrame) -> None:
        """Write the image; its row is collected for the list."""
        split = FOLDERS[frame.split]
        name = f"img{frame.number:06d}.png"
        self._output.write(f"images/{split}/{name}", frame.read("png"))
        w, x, y, z = frame.truth.q_camera_from_target_wxyz
        numbers = (*frame.truth.t_camera_from_target_m, x, y, z, w)
        scene: SceneState | None = getattr(frame.truth, "scene", None)  # an imported image has none
        step = scene.sample.sequence if scene is not None and scene.sample else None
        sequence = "" if step is None else f"{step.sequence:03d}"
        self._rows.setdefault(split, []).append([sequence, name, *(repr(v) for v in numbers)])

    def finish(self) -> None:
        """Write the lists and the camera."""
        for split, rows in self._rows.items():
            self._output.write(f"{split}.csv", table_bytes(("sequence", *COLUMNS), rows=rows))
        self._output.write("camera.json", json_bytes(speed_camera(self._card.camera)))


def read_spark(place: Path) -> PosedPictures | None:
    """Read a folder like SPARK or one of its lists; None for a folder of another kind.

    Raises
    ------
    UserError
        If it holds several lists, a row has a mistake, or an image is missing.
    """
    lists = [place] if place.is_file() else sorted(place.glob("*.csv"))
    lists = [path for path in lists if path.suffix == ".csv" and _is_spark(path)]
    if not lists:
        return None
    if len(lists) > 1:
        raise UserError(f"{place} holds several sets ({', '.join(map(str, lists))}); give one of these lists")
    labels = lists[0]
    folder = labels.parent
    pictures = []
    for k, row in enumerate(read_csv(labels, COLUMNS)):
        source = f"{labels} line {k + 2}"
        pose = checked_pose(
            [row["Qw"], row["Qx"], row["Qy"], row["Qz"]], [row["Tx"], row["Ty"], row["Tz"]], source
        )
        places = [folder / "images" / labels.stem, folder / "images", folder]
        if row.get("sequence"):
            places = [
                *(place / row["sequence"] for place in places if _is_plain_name(row["sequence"])),
                *places,
            ]
        name = row["filename"]
        pictures.append(PosedPicture(name, find_picture(labels, places, name), pose))
    return PosedPictures(labels, tuple(pictures), find_camera(folder, levels=1), encoding="srgb")


def _is_plain_name(name: str) -> bool:
    return name.replace("_", "").replace("-", "").isalnum()


def _is_spark(path: Path) -> bool:
    if not path.is_file():  # opening a pipe would block
        return False
    with path.open("rb") as file:
        head = file.readline(1000)
    return {b"filename", b"Tx", b"Qw"} <= {cell.strip() for cell in head.lstrip(b"\xef\xbb\xbf").split(b",")}


def _spark(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return SparkWriter(output, card)


SPARK = DatasetFormat(
    name="spark",
    title="SPARK (Luxembourg)",
    carries="image, pose and sequence",
    lacks="masks, boxes, keypoints and layers",
    writer=_spark,
    read=read_spark,
    problem=fisheye_problem,
)
