"""Data sets read back from export formats, by the usual library of the format where one exists.

Each reader yields the differences of one format from the native layout, one sentence per frame.
"""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.dataset.formats.registry import read_foreign
from flyaround.simulator.dataset.labelled_dataset import open_dataset

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

    Frames = dict[int, LabelledFrame]

SHORT = {"": "train", "train": "train", "validation": "val", "test": "test"}
_JPEG_DN = 2.0  # maximum mean difference due to lossy compression, after smoothing


def read_back(folder: Path, name: str) -> list[str]:
    """Return the errors of one export format against the native layout; empty if there are none."""
    frames = {frame.number: frame for frame in open_dataset(folder)}
    faults = dict(_READERS[name](folder / name, frames))
    wrong = [f"{name}, frame {k}: {fault}" for k, fault in faults.items() if fault]
    return wrong + [f"{name}: frame {k} is missing" for k in sorted(frames.keys() - faults.keys())]


def _splits(frames: Frames) -> list[str]:
    return sorted({frame.split or "train" for frame in frames.values()})


def _poses_differ(frame: LabelledFrame, R: Any, t_m: Any) -> str:  # noqa: ANN401 - arrays of any library
    if np.abs(np.asarray(R) - frame.pose.R).max() > 1e-8:
        return "another attitude"
    return "" if np.allclose(t_m, frame.pose.t_m, atol=1e-8) else "another place"


def _speed(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    for split in _splits(frames):
        pictures, _ = read_foreign(root / f"{split}.json", "speed")
        for picture in pictures.pictures:
            number = int(picture.path.stem.removeprefix("img"))
            frame = frames[number]
            image = cv2.imread(str(picture.path), cv2.IMREAD_UNCHANGED)
            original = frame.image if frame.image.ndim == 2 else frame.image[..., ::-1]
            pose = picture.camera_from_target
            if image is None or image.shape != original.shape:
                yield number, "no image of the native one's size and bands"
            elif np.abs(_smooth(image) - _smooth(original)).mean() > _JPEG_DN:
                yield number, "another image"
            else:
                yield number, _poses_differ(frame, pose.R, pose.t_m)


def _smooth(image: Any) -> Any:  # noqa: ANN401 - an array
    """Smooth an image, because JPEG keeps the low frequencies of colour noise only."""
    return cv2.blur(image.astype(np.float32), (5, 5))


def _bop(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    """Yield errors of a BOP export against its specification, docs/bop_datasets_format.md of bop_toolkit."""
    for split in _splits(frames):
        scene = root / SHORT[split] / "000000"
        gt, info, cameras = (
            json.loads((scene / f"scene_{n}.json").read_text()) for n in ("gt", "gt_info", "camera")
        )
        for key, (one,) in gt.items():
            frame = frames[int(key)]
            kind = "gray" if frame.image.ndim == 2 else "rgb"
            image = cv2.imread(str(scene / kind / f"{frame.number:06d}.png"), cv2.IMREAD_UNCHANGED)
            mask = cv2.imread(
                str(scene / "mask_visib" / f"{frame.number:06d}_000000.png"), cv2.IMREAD_UNCHANGED
            )
            original = frame.image if frame.image.ndim == 2 else frame.image[..., ::-1]
            (entry,) = info[key]
            if image is None or not np.array_equal(image, original):
                yield frame.number, "another image"
            elif mask is None or not np.array_equal(mask, frame.mask):
                yield frame.number, "another mask"
            elif entry["px_count_visib"] != np.count_nonzero(mask):
                yield frame.number, "another number of pixels"
            elif not np.allclose(np.reshape(cameras[key]["cam_K"], (3, 3)), frame.camera.K):
                yield frame.number, "another camera"
            else:
                R, t_mm = np.reshape(one["cam_R_m2c"], (3, 3)), np.array(one["cam_t_m2c"])
                yield frame.number, _poses_differ(frame, R, t_mm / 1e3)


def _coco(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    coco_module = importlib.import_module("pycocotools.coco")
    for split in _splits(frames):
        coco = coco_module.COCO(str(root / "annotations" / f"{split}.json"))
        for number in coco.getImgIds():
            frame = frames[number]
            one = coco.loadAnns(coco.getAnnIds(imgIds=[number]))
            if not (root / "images" / split / coco.loadImgs([number])[0]["file_name"]).is_file():
                yield number, "no image"
            elif not one:
                yield number, "no annotation" if frame.mask.any() else ""
            elif not np.array_equal(coco.annToMask(one[0]) > 0, frame.mask > 0):
                yield number, "another mask"
            else:
                exported = np.reshape(one[0]["keypoints"], (-1, 3))
                recorded = [(k.state, k.pixel_px) for k in frame.truth.keypoints]
                good = all(
                    bool(v) == (state != "out_of_frame")
                    and (not v or np.allclose((x - 0.5, y - 0.5), np.asarray(pixel)))
                    for (x, y, v), (state, pixel) in zip(exported, recorded, strict=True)
                )
                yield number, "" if good else "other keypoints"


def _yolo(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    """Yield errors of a YOLO export against its specification, docs.ultralytics.com/datasets/pose."""
    for split in _splits(frames):
        for path in sorted((root / "labels" / SHORT[split]).glob("*.txt")):
            frame = frames[int(path.stem)]
            image = cv2.imread(str(root / "images" / SHORT[split] / f"{path.stem}.png"), cv2.IMREAD_UNCHANGED)
            original = frame.image if frame.image.ndim == 2 else frame.image[..., ::-1]
            cells = [float(word) for word in path.read_text().split()]
            if image is None or not np.array_equal(image, original):
                yield frame.number, "another image"
            elif not cells:
                yield frame.number, "no box" if frame.mask.any() else ""
            else:
                W, H = frame.camera.width_px, frame.camera.height_px
                cx, cy, w, h = np.multiply(cells[1:5], (W, H, W, H))
                is_equal = np.allclose(
                    (cx - w / 2, cy - h / 2, w, h), cv2.boundingRect(frame.mask), atol=1e-3
                )
                count = len(frame.truth.keypoints)
                yield frame.number, "" if is_equal and len(cells) == 5 + 3 * count else "another box"


def _webdataset(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    webdataset = importlib.import_module("webdataset")
    shards = [str(path) for path in sorted(root.glob("*.tar"))]
    for sample in webdataset.WebDataset(shards, shardshuffle=False, empty_check=False):
        frame = frames[int(sample["__key__"])]
        is_equal = all(sample[ending] == frame.read(ending) for ending in ("png", "mask.png", "json"))
        yield frame.number, "" if is_equal else "other bytes than the native files"


def _parquet(root: Path, frames: Frames) -> Iterator[tuple[int, str]]:
    datasets = importlib.import_module("datasets")
    rows = datasets.load_dataset(str(root), cache_dir=str(root.parent / "cache"), streaming=True)
    for split in rows.values():
        for row in split:
            frame = frames[row["number"]]
            if not np.array_equal(np.asarray(row["image"]), frame.image):
                yield frame.number, "another image"
            elif not np.array_equal(np.asarray(row["mask"]), frame.mask):
                yield frame.number, "another mask"
            elif tuple(row["q_camera_from_target_wxyz"]) != frame.truth.q_camera_from_target_wxyz:
                yield frame.number, "another attitude"
            else:
                is_equal = tuple(row["t_camera_from_target_m"]) == frame.truth.t_camera_from_target_m
                yield frame.number, "" if is_equal else "another place"


_READERS: dict[str, Callable[[Path, Frames], Iterator[tuple[int, str]]]] = {
    "speed": _speed,
    "bop": _bop,
    "coco": _coco,
    "yolo": _yolo,
    "webdataset": _webdataset,
    "parquet": _parquet,
}
FORMATS = tuple(_READERS)
