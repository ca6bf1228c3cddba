"""The native layout of a data set: images/NNNNNN.png, .mask.png, layers, .json; the .json is written last."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.dataset.formats.exr import (
    MAX_BYTES,
    MAX_SIDE_PX,
    encode_exr,
    read_exr,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import truth_to_json
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.untrusted_files import read_regular, refuse_link_out
from flyaround.simulator.targets.textures import picture_size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray

_PNG = b"\x89PNG\r\n\x1a\n"
PNG_LAYERS = ("amodal", "parts", "clean")
EXR_CHANNELS = {"depth": ("Z",), "normals": ("X", "Y", "Z"), "flow": ("U", "V")}


@dataclass(frozen=True)
class FramePaths:
    """Files of frame k."""

    image: Path
    mask: Path
    truth: Path


def frame_paths(folder: Path, k: int) -> FramePaths:
    """Return the paths of frame k of a data set.

    Returns
    -------
    FramePaths
        Image, mask and record in the folder ``images``; they need not exist.
    """
    stem = folder / "images" / f"{k:06d}"
    return FramePaths(stem.with_suffix(".png"), stem.with_suffix(".mask.png"), stem.with_suffix(".json"))


def encode_png(image: NDArray[np.unsignedinteger]) -> bytes:
    """Encode a mono or RGB image of 8 or 16 bits as PNG.

    OpenCV's default strategy (one filter, run lengths) is faster than any explicit level, and its files are no larger,
    because noise does not compress.

    Returns
    -------
    bytes
        Content of a PNG file of the image's depth.

    Raises
    ------
    RuntimeError
        If OpenCV cannot encode it.
    """
    bgr = image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])
    ok, data = cv2.imencode(".png", bgr)
    if not ok:
        raise RuntimeError("OpenCV could not encode a PNG")
    return data.tobytes()


def read_png(path: Path) -> NDArray[np.unsignedinteger]:
    """Read a PNG as written; an alpha channel is dropped.

    Returns
    -------
    (H, W) or (H, W, 3) array
        Mono or RGB, uint8 or uint16.

    Under another suffix than .png, any format of Pillow and OpenCV is read.

    Raises
    ------
    UserError
        If the file is missing, not an image, not a PNG under the suffix .png, too large, or not of 8 or 16 bits.
    """
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError:
        data = b""
    return _decode(data, str(path), picture_size(data) if path.suffix.lower() != ".png" else None)


def read_bytes(path: Path) -> bytes:
    """Read the bytes of one of a frame's files.

    Raises
    ------
    UserError
        If it is missing or cannot be read.
    """
    try:
        return read_regular(path, MAX_BYTES)
    except OSError as error:
        raise UserError(
            f"cannot read {path}: {error.strerror or error}; run flyaround check on the data set"
        ) from error


def decode_png(data: bytes, source: str) -> NDArray[np.unsignedinteger]:
    """Decode a PNG from its bytes, as `read_png` does; ``source`` names it in messages.

    Raises
    ------
    UserError
        If it is not a PNG, too large, or not of 8 or 16 bits.
    """
    return _decode(data, source, None)


def _decode(data: bytes, source: str, size: tuple[int, int] | None) -> NDArray[np.unsignedinteger]:
    """Decode an image; ``size`` is that of a format other than PNG, which Pillow reads up to 13,000 x 13,000 pixels."""
    if data.startswith(_PNG) and len(data) >= 24:
        size = struct.unpack_from(">II", data, 16)  # a PNG states its size in its first chunk
    if size is not None and max(size) > MAX_SIDE_PX:
        raise UserError(
            f"image {source} has {size[0]:,} x {size[1]:,} pixels, and at most {MAX_SIDE_PX:,} x "
            f"{MAX_SIDE_PX:,} are read; make it smaller"
        )
    image = None if size is None else cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise UserError(f"cannot read image {source}; it is missing or not a PNG")
    dtype = image.dtype.type
    if dtype not in (np.uint8, np.uint16):
        raise UserError(f"image {source} holds {image.dtype} pixels; save it with 8 or 16 bits")
    return np.ascontiguousarray(image if image.ndim == 2 else image[..., 2::-1])


def layer_path(folder: Path, stem: str, name: str) -> Path:
    """Return the path of a layer of the frame with file name stem ``stem``."""
    return folder / f"{stem}.{name}.{'png' if name in PNG_LAYERS else 'exr'}"


def encode_layers(frame: Frame) -> dict[str, bytes]:
    """Return the files of a frame's layers by name; part numbers take 8 bits if they fit."""
    files = {}
    for name, layer in frame.layers.items():
        if name in EXR_CHANNELS:
            files[name] = encode_exr(EXR_CHANNELS[name], layer)
        elif name == "parts" and layer.max(initial=0) < 256:
            files[name] = encode_png(layer.astype(np.uint8))
        else:
            files[name] = encode_png(layer)
    return files


def write_layers(folder: Path, stem: str, frame: Frame) -> None:
    """Write the layers of a frame."""
    for name, data in encode_layers(frame).items():
        write_atomic(layer_path(folder, stem, name), data)


def read_layer(folder: Path, stem: str, name: str) -> NDArray[Any]:
    """Read a layer as drawn, in the type and shape that the record's hash refers to.

    Returns
    -------
    (H, W) or (H, W, C) array
        Values in the type and shape that the record's hash refers to, with parts as uint16.

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


@dataclass(frozen=True, eq=False)
class EncodedFrame:
    """A frame as the bytes of its files: image, mask, record, layers by name, and measurements of plug-in sensors."""

    image: bytes
    mask: bytes
    truth: bytes
    layers: dict[str, bytes]
    sensors: dict[str, bytes] = field(default_factory=dict)


def encode_frame(frame: Frame) -> EncodedFrame:
    """Encode the files of a labelled frame.

    Raises
    ------
    RuntimeError
        If the frame has no labels.
    """
    if frame.truth is None or frame.mask is None:
        raise RuntimeError("a data set frame needs labels")
    mask: ByteArray = frame.mask
    return EncodedFrame(
        encode_png(frame.image), encode_png(mask), truth_to_json(frame.truth), encode_layers(frame)
    )


def write_frame(folder: Path, k: int, frame: Frame) -> FramePaths:
    """Write frame k, as `write_encoded` does.

    Returns
    -------
    FramePaths
        Written image, mask and truth record.
    """
    return write_encoded(folder, k, encode_frame(frame))


def frame_files(k: int, files: EncodedFrame) -> list[tuple[str, bytes]]:
    """Return names and bytes of frame k's files, its truth record last: a record marks a complete frame."""
    paths = frame_paths(Path(), k)
    layers = {layer_path(Path("images"), f"{k:06d}", name): data for name, data in files.layers.items()}
    measurements = {Path("images") / f"{k:06d}.{name}": data for name, data in files.sensors.items()}
    files_by_path = {
        paths.image: files.image,
        paths.mask: files.mask,
        **layers,
        **measurements,
        paths.truth: files.truth,
    }
    return [(path.as_posix(), data) for path, data in files_by_path.items()]


def write_encoded(folder: Path, k: int, files: EncodedFrame) -> FramePaths:
    """Write frame k; its truth record comes last.

    Raises
    ------
    UserError
        If the disk is full or the folder cannot be written.
    """
    for name, data in frame_files(k, files):
        write_atomic(folder / name, data)
    return frame_paths(folder, k)


def is_frame_complete(folder: Path, k: int) -> bool:
    """Return True if frame k is complete.

    Returns
    -------
    bool
        True if image, mask and record exist; their contents are not read.

    Raises
    ------
    UserError
        If a link leads one of its files out of the folder.
    """
    paths = frame_paths(folder, k)
    if not (paths.truth.is_file() and paths.image.is_file() and paths.mask.is_file()):
        return False
    if paths.truth.parent.is_symlink() or any(p.is_symlink() for p in (paths.truth, paths.image, paths.mask)):
        for path in (paths.truth, paths.image, paths.mask):
            refuse_link_out(path, folder)
    return True
