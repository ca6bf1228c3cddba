"""NPZ and EXR: each frame as arrays in one file.

``SPLIT/NNNNNN.npz``: image, mask, pose, camera, keypoints and the layers, as numpy reads them. ``SPLIT/NNNNNN.exr``:
the image, the mask and the layers as float channels; pose and camera in ``SPLIT/NNNNNN.json``, the native record.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from flyaround.simulator.dataset.formats.base import (
    ArraysOutput,
    DatasetFormat,
    FormatOutput,
    FormatWriter,
    encoding_key,
)
from flyaround.simulator.dataset.formats.eight_bits import image_bits
from flyaround.simulator.dataset.formats.exr import encode_channels
from flyaround.simulator.dataset.formats.native import EXR_CHANNELS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

Arrays: TypeAlias = "dict[str, NDArray[Any]]"
NO_CHANNELS = ("amodal",)  # larger than the image


class NpzWriter:
    """Writer of data sets in the NPZ format."""

    def __init__(self, output: FormatOutput) -> None:
        self._output = output

    def write(self, frame: LabelledFrame) -> None:
        """Write one file."""
        _write_output(
            self._output, f"{frame.split or 'train'}/{frame.number:06d}.npz", arrays_of(frame), encode_npz
        )

    def finish(self) -> None:
        """Do nothing: the format has no file for all frames."""


def _write_output(output: FormatOutput, name: str, arrays: Arrays, encode: Callable[[Arrays], bytes]) -> None:
    if isinstance(output, ArraysOutput):
        output.write_arrays(name, arrays)
    else:
        output.write(name, encode(arrays))


def encode_npz(arrays: Arrays) -> bytes:
    """Return the bytes of a compressed NPZ file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def arrays_of(frame: LabelledFrame) -> Arrays:
    """Return every number and name of a frame, by name."""
    truth, camera = frame.truth, frame.camera
    nan = (np.nan, np.nan)
    arrays: dict[str, Any] = {
        "number": frame.number,
        "image": frame.image,
        "image_bits": image_bits(frame),
        "mask": frame.mask,
        "q_camera_from_target_wxyz": truth.q_camera_from_target_wxyz,
        "t_camera_from_target_m": truth.t_camera_from_target_m,
        "camera_matrix": camera.K,
        "distortion": np.array(camera.distortion.coefficients, float),
        "distortion_model": camera.distortion.model,
        **encoding_key(camera),
        "box_px": np.array(truth.box_px or (np.nan,) * 4),
        "feasible": truth.feasible,
        "keypoints_name": np.array([k.name for k in truth.keypoints], "U"),
        "keypoints_target_m": np.array([k.target_m for k in truth.keypoints], float).reshape(-1, 3),
        "keypoints_pixel_px": np.array([k.pixel_px or nan for k in truth.keypoints], float).reshape(-1, 2),
        "keypoints_state": np.array([k.state for k in truth.keypoints], "U"),
    }
    arrays |= {name: frame.layer(name) for name in frame.layers}
    return {name: np.asarray(value) for name, value in arrays.items()}


class ExrWriter:
    """Writer of data sets in the EXR format."""

    def __init__(self, output: FormatOutput) -> None:
        self._output = output

    def write(self, frame: LabelledFrame) -> None:
        """Write one image of many channels, and the record."""
        stem = f"{frame.split or 'train'}/{frame.number:06d}"
        channels = {name: np.asarray(plane, np.float32) for name, plane in channels_of(frame).items()}
        _write_output(self._output, f"{stem}.exr", channels, encode_channels)
        self._output.write(f"{stem}.json", frame.read("json"))

    def finish(self) -> None:
        """Do nothing: the format has no file for all frames."""


def channels_of(frame: LabelledFrame) -> Arrays:
    """Return image, mask and layers by channel: Y or R G B in digital numbers, ``mask`` 0 or 1, ``depth.Z``."""
    image = frame.image
    planes: dict[str, NDArray[Any]] = {"mask": frame.mask > 0}
    planes |= {"Y": image} if image.ndim == 2 else {c: image[..., k] for k, c in enumerate("RGB")}
    for name in frame.layers:
        if name in NO_CHANNELS:
            continue
        layer = frame.layer(name)
        if layer.ndim == 2:
            planes[f"{name}.{EXR_CHANNELS[name][0]}" if name in EXR_CHANNELS else f"{name}.Y"] = layer
        else:
            planes |= {f"{name}.{c}": layer[..., k] for k, c in enumerate(EXR_CHANNELS.get(name, "RGB"))}
    return planes


def _npz(output: FormatOutput, _card: DatasetCard) -> FormatWriter:
    return NpzWriter(output)


def _exr(output: FormatOutput, _card: DatasetCard) -> FormatWriter:
    return ExrWriter(output)


NPZ = DatasetFormat(
    name="npz",
    title="numpy arrays",
    carries="image, pose, camera, mask, box, keypoints with their states, and layers",
    lacks="the scene and its light",
    writer=_npz,
    deep_images=True,
)
EXR = DatasetFormat(
    name="exr",
    title="OpenEXR, a channel for each label",
    carries="image, mask and layers as float channels, and the native record",
    lacks="the amodal mask, which reaches beyond the image",
    writer=_exr,
    deep_images=True,
)
