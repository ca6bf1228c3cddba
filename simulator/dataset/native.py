"""The native layout of a data set: images/NNNNNN.png, .mask.png, layers, .json; the .json is written last."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from simulator.dataset.exr import encode_exr, read_exr
from simulator.errors import UserError
from simulator.files import write_atomic
from simulator.labels.truth import truth_to_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.arrays import ByteArray
    from simulator.labels.frame import Frame

# PNG level 1: noise does not compress, and level 9 costs five times the time for 2 % of the size.
PNG_LEVEL = 1


PNG_LAYERS = ("amodal", "parts", "clean")
EXR_CHANNELS = {"depth": ("Z",), "normals": ("X", "Y", "Z"), "flow": ("U", "V")}


@dataclass(frozen=True)
class FramePaths:
    """Files of frame k."""

    image: Path
    mask: Path
    truth: Path


def frame_paths(folder: Path, k: int) -> FramePaths:
    """Where frame k of a data set lies."""
    stem = folder / "images" / f"{k:06d}"
    return FramePaths(stem.with_suffix(".png"), stem.with_suffix(".mask.png"), stem.with_suffix(".json"))


def encode_png(image: NDArray[np.unsignedinteger]) -> bytes:
    """PNG bytes of a mono or RGB image of 8 or 16 bits."""
    bgr = image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])
    ok, data = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL])
    if not ok:
        raise RuntimeError("OpenCV could not encode a PNG")
    return data.tobytes()


def read_png(path: Path) -> NDArray[np.unsignedinteger]:
    """Read a PNG as written: mono (H, W) or RGB (H, W, 3).

    Raises
    ------
    UserError
        If the file is missing or not an image.
    """
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    if image is None:
        raise UserError(f"cannot read image {path}; it is missing or not a PNG")
    dtype = np.uint8 if image.dtype == np.uint8 else np.uint16
    return np.ascontiguousarray(image if image.ndim == 2 else image[..., ::-1], dtype)


def layer_path(folder: Path, stem: str, name: str) -> Path:
    """Where a layer of the frame called ``stem`` lies."""
    return folder / f"{stem}.{name}.{'png' if name in PNG_LAYERS else 'exr'}"


def write_layers(folder: Path, stem: str, frame: Frame) -> None:
    """Write the layers of a frame; ids of parts take 8 bits where they fit."""
    for name, layer in frame.layers.items():
        if name in EXR_CHANNELS:
            data = encode_exr(EXR_CHANNELS[name], layer)
        elif name == "parts" and layer.max(initial=0) < 256:
            data = encode_png(layer.astype(np.uint8))
        else:
            data = encode_png(layer)
        write_atomic(layer_path(folder, stem, name), data)


def read_layer(folder: Path, stem: str, name: str) -> NDArray[Any]:
    """A layer as it was drawn, of the type and shape that the record's hash is of.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    path = layer_path(folder, stem, name)
    if name in EXR_CHANNELS:
        return read_exr(path, EXR_CHANNELS[name])
    image = read_png(path)
    return image.astype(np.uint16) if name == "parts" else image


def write_frame(folder: Path, k: int, frame: Frame) -> FramePaths:
    """Write frame k; its truth record comes last, so that a record means a whole frame.

    Raises
    ------
    UserError
        If the disk is full or the folder cannot be written.
    """
    paths = frame_paths(folder, k)
    if frame.truth is None or frame.mask is None:
        raise RuntimeError("a data set frame needs labels")
    mask: ByteArray = frame.mask
    write_atomic(paths.image, encode_png(frame.image))
    write_atomic(paths.mask, encode_png(mask))
    write_layers(folder / "images", f"{k:06d}", frame)
    write_atomic(paths.truth, truth_to_json(frame.truth))
    return paths


def is_whole(folder: Path, k: int) -> bool:
    """Whether frame k was written to the end."""
    paths = frame_paths(folder, k)
    return paths.truth.is_file() and paths.image.is_file() and paths.mask.is_file()
