"""Python access to a data set: its frames in order, decoded on access."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from flyaround.simulator.dataset.card import DatasetCard, read_card
from flyaround.simulator.dataset.formats.labelled_frame import SPLITS, LabelledFrame, frame_from_folder
from flyaround.simulator.dataset.formats.native import is_frame_complete
from flyaround.simulator.dataset.split import read_split
from flyaround.simulator.errors import UserError, missing_extra

if TYPE_CHECKING:
    from collections.abc import Callable


class LabelledDataset(Sequence[LabelledFrame]):
    """The complete frames of a data set.

    Parameters
    ----------
    folder : Path
        Folder of the data set.
    card : DatasetCard
        Card of the data set.
    numbers : sequence of int
        Numbers of the frames, in order.
    splits : dict
        Split of each frame, if any.
    """

    def __init__(
        self, folder: Path, card: DatasetCard, numbers: Sequence[int], splits: dict[int, str]
    ) -> None:
        self.folder, self.card, self.numbers = folder, card, tuple(numbers)
        self._splits = splits

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> LabelledFrame: ...

    @overload
    def __getitem__(self, index: slice) -> LabelledDataset: ...

    def __getitem__(self, index: int | slice) -> LabelledFrame | LabelledDataset:
        if isinstance(index, slice):
            return LabelledDataset(self.folder, self.card, self.numbers[index], self._splits)
        number = self.numbers[index]
        return frame_from_folder(self.folder, number, self._splits.get(number, ""))

    def torch(self, transform: Callable[[dict[str, Any]], Any] | None = None) -> Any:  # noqa: ANN401 - torch is optional
        """Return the data set as a `torch.utils.data.Dataset`.

        Parameters
        ----------
        transform : callable, optional
            Function applied to each item: a dict of tensors ``image`` (C, H, W) float32 0..1, ``mask`` (H, W) bool,
            ``q_camera_from_target_wxyz`` (4,), ``t_camera_from_target_m`` (3,), ``camera_matrix`` (3, 3),
            ``keypoints_px`` (K, 2), NaN behind the camera, ``keypoints_visible`` (K,) bool, and ``number``.

        Returns
        -------
        torch.utils.data.Dataset
            Data set with one item per frame.

        Raises
        ------
        UserError
            If torch is not installed.
        """
        try:
            from flyaround.simulator.dataset.torch_dataset import TorchFrames  # noqa: PLC0415 - torch is optional
        except ImportError as error:
            raise missing_extra("a torch data set", "train", error) from error
        return TorchFrames(self, transform)


def open_dataset(folder: str | Path, split: str | None = None) -> LabelledDataset:
    """Open a data set written by `capture` or `convert`.

    Parameters
    ----------
    folder : str or Path
        Data set.
    split : str, optional
        Train, validation or test; by default all frames.

    Returns
    -------
    LabelledDataset
        Sequence of the frames that are complete, in order.

    Raises
    ------
    UserError
        If the folder is not a data set, has no complete frame, or is not split.
    """
    folder = Path(folder)
    card = read_card(folder)
    splits = read_split(folder)
    if split is not None and split not in SPLITS:
        raise UserError(f"there is no split '{split}'; choose from {', '.join(SPLITS)}")
    if split is not None and not splits:
        raise UserError(f"data set {folder} is not split; capture it with --split 8:1:1")
    numbers = [
        k
        for k in range(card.n_frames)
        if (split is None or splits.get(k) == split) and is_frame_complete(folder, k)
    ]
    if not numbers:
        raise UserError(
            f"data set {folder} has no complete frame{'' if split is None else f' of split {split}'}; capture more"
        )
    return LabelledDataset(folder, card, numbers, splits)
