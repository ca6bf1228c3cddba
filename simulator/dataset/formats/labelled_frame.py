"""One frame of a data set for readers and writers of formats: files as bytes, decoded on access."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.dataset.formats.exr import decode_exr
from flyaround.simulator.dataset.formats.native import (
    EXR_CHANNELS,
    PNG_LAYERS,
    EncodedFrame,
    decode_png,
    frame_paths,
    read_bytes,
)
from flyaround.simulator.labels.imported import LabelRecord, parse_label_record
from flyaround.simulator.runtime.untrusted_files import refuse_link_out
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import ByteArray

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """A frame with its labels.

    Parameters
    ----------
    number : int
        Number in its data set.
    read : callable
        Function that returns the bytes of a file by its native suffix: ``png``, ``mask.png``, ``json``, ``depth.exr``.
    where : str, optional
        Name of the file in error messages.
    split : str, optional
        Train, validation, test, or empty if the data set is not split.
    decoded : dict, optional
        Layers that have been decoded already, by name.
    """

    number: int
    read: Callable[[str], bytes]
    where: str = "frame"
    split: str = ""
    decoded: dict[str, NDArray[Any]] = field(default_factory=dict, repr=False)

    @cached_property
    def image(self) -> NDArray[np.unsignedinteger]:
        """Digital numbers, (H, W) or (H, W, 3) in RGB order, 8 or 16 bits."""
        return decode_png(self.read("png"), f"{self.where}.png")

    @cached_property
    def mask(self) -> ByteArray:
        """(H, W) uint8, 255 where the target covers the pixel's centre."""
        return np.asarray(decode_png(self.read("mask.png"), f"{self.where}.mask.png"), np.uint8)

    @cached_property
    def truth(self) -> LabelRecord:
        """The label record."""
        return parse_label_record(self.read("json"), Path(f"{self.where}.json"))

    @property
    def camera(self) -> Camera:
        """Intrinsics and lens."""
        return self.truth.camera

    @property
    def pose(self) -> Pose:
        """``camera_from_target``: ``x_camera = pose.R @ x_target + pose.t_m``."""
        return Pose(
            "camera", "target", self.truth.q_camera_from_target_wxyz, self.truth.t_camera_from_target_m
        )

    @property
    def range_m(self) -> float:
        """Distance of the target's origin from the camera [m]."""
        return float(np.linalg.norm(self.truth.t_camera_from_target_m))

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the label layers that have a file."""
        return tuple(getattr(self.truth, "layer_sha256", {}))

    def layer(self, name: str) -> NDArray[Any]:
        """Return a label layer: depth (H, W) float32 [m], normals (H, W, 3), flow (H, W, 2), parts, amodal, clean.

        Returns
        -------
        (H, W) or (H, W, 3) or (H, W, 2) array
            Values of the layer, one per pixel of the image; those of ``amodal`` reach beyond it.

        Raises
        ------
        KeyError
            If the frame has no such layer.
        """
        if name not in self.layers:
            raise KeyError(f"{self.where} has no layer {name!r}; it has {', '.join(self.layers) or 'none'}")
        if name not in self.decoded:
            self.decoded[name] = self._decode(name)
        return self.decoded[name]

    def _decode(self, name: str) -> NDArray[Any]:
        data = self.layer_bytes(name)
        if name in EXR_CHANNELS:
            return decode_exr(data, EXR_CHANNELS[name], f"{self.where}.{name}.exr")
        image = decode_png(data, f"{self.where}.{name}.png")
        return image.astype(np.uint16) if name == "parts" else image

    def layer_bytes(self, name: str) -> bytes:
        """Return the file of a layer.

        Returns
        -------
        bytes
            Content of the PNG or EXR file.
        """
        return self.read(f"{name}.{layer_ending(name)}")


def layer_ending(name: str) -> str:
    """Return the suffix of a layer's file."""
    return "png" if name in PNG_LAYERS else "exr"


def frame_from_files(number: int, files: EncodedFrame, split: str = "") -> LabelledFrame:
    """Return a frame from its encoded files."""
    contents = {"png": files.image, "mask.png": files.mask, "json": files.truth}
    contents |= {f"{name}.{layer_ending(name)}": data for name, data in files.layers.items()}
    return LabelledFrame(number, contents.__getitem__, f"frame {number:06d}", split)


def frame_from_folder(folder: Path, number: int, split: str = "") -> LabelledFrame:
    """Return frame ``number`` of a native data set; its files are read on access."""
    stem = frame_paths(folder, number).truth.with_suffix("")

    def read(ending: str) -> bytes:
        path = stem.with_name(f"{stem.name}.{ending}")
        refuse_link_out(path, folder)
        return read_bytes(path)

    return LabelledFrame(number, read, str(stem), split)


def native_names(frame: LabelledFrame) -> list[tuple[str, bytes]]:
    """Return suffixes and bytes of all files of a frame, as in the native layout."""
    endings = ["png", "mask.png", *(f"{name}.{layer_ending(name)}" for name in frame.layers), "json"]
    return [(ending, frame.read(ending)) for ending in endings]
