"""COCO: keypoints, boxes and segmentation of the craft, as run lengths and polygons; parts by class if available.

``images/SPLIT/NNNNNN.png``; ``annotations/SPLIT.json`` with run lengths, which represent the mask exactly;
``annotations/SPLIT_polygons.json`` with outlines, for loaders that accept polygons only (holes are filled);
``annotations/SPLIT_parts.json`` with a category for each class of parts, from the layer ``parts``. COCO's origin is the
corner of the first pixel, not its centre, so all positions are shifted by half a pixel.

References
----------
Lin et al. (2014), Microsoft COCO: Common Objects in Context; https://cocodataset.org/#format-data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter, encoding_key
from flyaround.simulator.dataset.formats.speed_writer import json_bytes
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.boxes import craft_window
from flyaround.simulator.labels.part_classes import PART_CLASSES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.labels.truth import KeypointState
    from flyaround.simulator.runtime.arrays import ByteArray

CORNER_PX = 0.5
"""Offset from positions with (0, 0) at the first pixel's centre to those at its corner."""

# Category numbers of the target, and of its first part class.
CRAFT_ID, FIRST_CLASS_ID = 1, 2

# Factor of the frame's number in the id of a part annotation, above every category number.
IDS_OF_FRAME = 16

# COCO's visibility flags of a keypoint.
NOT_LABELLED, HIDDEN, SEEN = 0, 1, 2


def visibility(state: KeypointState) -> int:
    """Return COCO's v: 0 outside the image, 1 inside but not visible (hidden, unlit or without contrast), 2 visible."""
    return {"out_of_frame": NOT_LABELLED, "visible": SEEN}.get(state, HIDDEN)


def keypoint_triples(frame: LabelledFrame) -> list[tuple[float, float, int]]:
    """Return x, y at pixel corners and v of each keypoint; zeros if v is 0."""
    triples = []
    for k in frame.truth.keypoints:
        v = visibility(k.state)
        x, y = (0.0, 0.0) if k.pixel_px is None or v == NOT_LABELLED else k.pixel_px
        shift = CORNER_PX if v else 0.0
        triples.append((x + shift, y + shift, v))
    return triples


def run_lengths(mask: NDArray[Any]) -> dict[str, Any]:
    """Return COCO's uncompressed run lengths of a mask (H, W), column by column, zeros first."""
    height, width = mask.shape
    _, columns = craft_window(mask)
    flat = (mask[:, columns] > 0).T.ravel()  # empty columns belong to the first and last run
    starts = np.flatnonzero(np.diff(flat, prepend=False)) + columns.start * height
    counts = np.diff(np.concatenate([[0], starts, [width * height]])).tolist()
    if flat.size and flat[-1] and columns.stop < width:
        last_run = (columns.stop * height) - int(starts[-1])
        counts[-1:] = [last_run, counts[-1] - last_run]
    return {"size": [height, width], "counts": counts}


def polygons(mask: ByteArray) -> list[list[float]]:
    """Return outlines of a mask's components, x y at pixel corners, a quarter pixel inside; holes are filled."""
    rows, columns = craft_window(mask)
    part = (mask[rows, columns] > 0).astype(np.uint8)
    if not part.size:
        return []
    doubled = np.repeat(np.repeat(part, 2, axis=0), 2, axis=1)
    first = (columns.start, rows.start)
    outlines, _ = cv2.findContours(doubled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return [((o.reshape(-1, 2) + 0.5) / 2 + first).ravel().tolist() for o in outlines if len(o) >= 3]


def box_xywh(box: tuple[float, float, float, float]) -> list[float]:
    """Convert a box at pixel edges to COCO's x, y, width, height."""
    x0, y0, x1, y1 = (v + CORNER_PX for v in box)
    return [x0, y0, x1 - x0, y1 - y0]


class CocoWriter:
    """Writer of data sets in the COCO format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        self._images: dict[str, list[dict[str, Any]]] = {}
        self._objects: dict[str, list[tuple[dict[str, Any], list[list[float]]]]] = {}
        self._parts: dict[str, list[dict[str, Any]]] = {}

    def write(self, frame: LabelledFrame) -> None:
        """Write the image; its annotations are collected for the lists."""
        split = frame.split or "train"
        name = f"{frame.number:06d}.png"
        self._output.write(f"images/{split}/{name}", frame.read("png"))
        camera = frame.camera
        self._images.setdefault(split, []).append(
            {
                "id": frame.number,
                "file_name": name,
                "width": camera.width_px,
                "height": camera.height_px,
                "camera_matrix": camera.K.tolist(),
                "distortion": list(camera.distortion.coefficients),
                **encoding_key(camera),
                "q_camera_from_target_wxyz": list(frame.truth.q_camera_from_target_wxyz),
                "t_camera_from_target_m": list(frame.truth.t_camera_from_target_m),
            }
        )
        box = frame.truth.box_px
        if box is None:  # the craft is not visible: an image without annotations
            return
        triples = keypoint_triples(frame)
        annotation = {
            "id": frame.number + 1,  # COCO's evaluation treats 0 as "none"
            "image_id": frame.number,
            "category_id": CRAFT_ID,
            "bbox": box_xywh(box),
            "area": int(np.count_nonzero(frame.mask)),
            "iscrowd": 0,
            "keypoints": [value for triple in triples for value in triple],
            "num_keypoints": sum(v > 0 for _, _, v in triples),
            "segmentation": run_lengths(frame.mask),
        }
        self._objects.setdefault(split, []).append((annotation, polygons(frame.mask)))
        if "parts" in frame.layers and self._card.target.part_classes:  # cards of earlier versions lack them
            self._parts.setdefault(split, []).extend(self._parts_of(frame))

    def _parts_of(self, frame: LabelledFrame) -> list[dict[str, Any]]:
        parts, classes = frame.layer("parts"), PART_CLASSES
        of_part = np.array(
            [0, *(FIRST_CLASS_ID + classes.index(name) for name in self._card.target.part_classes)], np.uint8
        )
        last = int(parts.max(initial=0))
        if last >= len(of_part):
            raise UserError(
                f"{frame.where}: part {last} has no class among the {len(of_part) - 1} of the card; draw it again"
            )
        ids = of_part[parts]
        annotations = []
        for category in np.unique(ids[ids > 0]).tolist():
            mask = (ids == category).astype(np.uint8)
            x, y, width, height = cv2.boundingRect(mask)
            annotations.append(
                {
                    "id": frame.number * IDS_OF_FRAME + category,
                    "image_id": frame.number,
                    "category_id": category,
                    "bbox": [x, y, width, height],
                    "area": int(np.count_nonzero(mask)),
                    "iscrowd": 0,
                    "segmentation": run_lengths(mask),
                }
            )
        return annotations

    def finish(self) -> None:
        """Write the lists of each split."""
        target = self._card.target
        craft = {
            "id": CRAFT_ID,
            "name": target.name,
            "supercategory": "spacecraft",
            "keypoints": list(target.keypoints),
            "skeleton": [],
        }
        classes = [
            {"id": FIRST_CLASS_ID + k, "name": name, "supercategory": target.name}
            for k, name in enumerate(PART_CLASSES)
        ]
        for split, images in self._images.items():
            objects = self._objects.get(split, [])
            lists: dict[str, tuple[list[dict[str, Any]], Any]] = {
                split: ([entry for entry, _ in objects], [craft]),
                f"{split}_polygons": ([entry | {"segmentation": p} for entry, p in objects if p], [craft]),
            }
            if split in self._parts:
                lists[f"{split}_parts"] = (self._parts[split], classes)
            for name, (entries, categories) in lists.items():
                document = {
                    "info": {"description": f"{self._card.scenario_name}, seed {self._card.seed}"},
                    "licenses": [{"id": 1, "name": self._card.licence}],
                    "images": images,
                    "annotations": entries,
                    "categories": categories,
                }
                self._output.write(f"annotations/{name}.json", json_bytes(document))


def _coco(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return CocoWriter(output, card)


COCO = DatasetFormat(
    name="coco",
    title="COCO keypoints and segmentation",
    carries="image, keypoints (v by state), box, mask as run lengths and polygons, parts by class, pose and camera",
    lacks="why a keypoint is not visible, depth and other layers",
    writer=_coco,
)
