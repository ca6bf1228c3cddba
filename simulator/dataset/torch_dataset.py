"""Frames of a data set as tensors; importing this module needs torch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch.utils.data import Dataset

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame


class TorchFrames(Dataset):  # type: ignore[misc] # torch is not type-checked here
    """Items as described in `flyaround.simulator.dataset.labelled_dataset.LabelledDataset.torch`.

    Parameters
    ----------
    frames : sequence of LabelledFrame
        The data set.
    transform : callable, optional
        Function applied to each item.
    """

    def __init__(
        self, frames: Sequence[LabelledFrame], transform: Callable[[dict[str, Any]], Any] | None = None
    ) -> None:
        self.frames, self._transform = frames, transform

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> Any:  # noqa: ANN401 - whatever the transform makes
        frame = self.frames[index]
        image = frame.image
        bands = image[None] if image.ndim == 2 else image.transpose(2, 0, 1)
        # as delivered: camera.encoding names the curve; digital numbers of 9 to 16 bits are right-aligned
        scene = getattr(frame.truth, "scene", None)
        bits = 8 * image.itemsize if scene is None else scene.sensor.bits
        truth = frame.truth
        nan = (np.nan, np.nan)
        item = {
            "number": frame.number,
            "image": torch.from_numpy(bands.astype(np.float32) / float(2**bits - 1)),
            "mask": torch.from_numpy(frame.mask > 0),
            "q_camera_from_target_wxyz": torch.tensor(truth.q_camera_from_target_wxyz),
            "t_camera_from_target_m": torch.tensor(truth.t_camera_from_target_m),
            "camera_matrix": torch.from_numpy(frame.camera.K.astype(np.float32)),
            "keypoints_px": torch.tensor([k.pixel_px or nan for k in truth.keypoints]).reshape(-1, 2),
            "keypoints_visible": torch.tensor([k.state == "visible" for k in truth.keypoints]),
        }
        return item if self._transform is None else self._transform(item)
