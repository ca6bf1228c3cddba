"""YOLO-pose as Ultralytics reads it: ``data.yaml``, ``images/SPLIT/NNNNNN.png`` and ``labels/SPLIT/NNNNNN.txt``.

A label line: class, box centre and size, then x, y, v of each keypoint, relative to the image's size, from its corner.

References
----------
https://docs.ultralytics.com/datasets/pose/
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import yaml

from flyaround.simulator.dataset.formats.base import (
    DatasetFormat,
    FormatOutput,
    FormatWriter,
    keypoint_problem,
)
from flyaround.simulator.dataset.formats.coco import box_xywh, keypoint_triples

if TYPE_CHECKING:
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

FOLDERS = {"": "train", "train": "train", "validation": "val", "test": "test"}


class YoloWriter:
    """Writer of data sets in the YOLO-pose format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._target = output, card.target
        self._splits: set[str] = set()

    def write(self, frame: LabelledFrame) -> None:
        """Write the image and its label line; an empty file if the craft is not visible."""
        split = FOLDERS[frame.split]
        self._splits.add(split)
        self._output.write(f"images/{split}/{frame.number:06d}.png", frame.read("png"))
        self._output.write(f"labels/{split}/{frame.number:06d}.txt", self._line(frame).encode())

    def _line(self, frame: LabelledFrame) -> str:
        box = frame.truth.box_px
        if box is None:
            return ""
        width, height = frame.camera.width_px, frame.camera.height_px
        x, y, w, h = box_xywh(box)
        shares = [(x + w / 2) / width, (y + h / 2) / height, w / width, h / height]
        cells = ["0", *(f"{share:.8f}" for share in shares)]
        for px, py, v in keypoint_triples(frame):
            cells += [f"{px / width:.8f}", f"{py / height:.8f}", str(v)]
        return " ".join(cells) + "\n"

    def finish(self) -> None:
        """Write ``data.yaml``. Ultralytics requires ``train`` and ``val``; a missing one is another existing split.

        There is no key ``path``: Ultralytics resolves a relative one against its own settings or the working directory,
        and without one uses the folder of the file.
        """
        existing = [split for split in ("train", "val", "test") if split in self._splits] or ["train"]
        missing = [split for split in ("train", "val") if split not in existing]
        keypoints = list(self._target.keypoints)
        comments = [
            "# keypoints have no mirror images: train with fliplr=0",
            "# folders are beside this file, wherever it is moved: give its full path as data=",
            *(
                f"# no frames are in {split}, a key that Ultralytics requires: it is the folder of {existing[0]}"
                for split in missing
            ),
        ]
        entries = {
            **{split: f"images/{split if split in existing else existing[0]}" for split in ("train", "val")},
            **({"test": "images/test"} if "test" in existing else {}),
            "kpt_shape": [len(keypoints), 3],
            "names": {0: self._target.name},
            "kpt_names": {0: keypoints},
        }
        text = yaml.safe_dump(entries, sort_keys=False, default_flow_style=None, width=math.inf)
        self._output.write("data.yaml", ("\n".join(comments) + "\n" + text).encode())


def _yolo(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return YoloWriter(output, card)


YOLO = DatasetFormat(
    name="yolo",
    title="YOLO-pose (Ultralytics)",
    carries="image, box and keypoints (v by state)",
    lacks="pose, camera, masks and layers",
    writer=_yolo,
    problem=keypoint_problem,
)
