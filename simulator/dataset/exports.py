"""The sink for exports: each verified frame gets its split and is written in every requested format."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.formats.base import FolderOutput, FormatOutput
from flyaround.simulator.dataset.formats.exr import MAX_BYTES
from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame, frame_from_files
from flyaround.simulator.dataset.formats.registry import NATIVE, find_format
from flyaround.simulator.dataset.split import SPLIT_NAME, Ratio, SplitAssigner, read_split, split_file
from flyaround.simulator.dataset.storage.store import FolderStore
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.storage.store import Store
    from flyaround.simulator.dataset.writer import CheckedFrame


@dataclass(frozen=True)
class StoreOutput:
    """Files under a folder of a store."""

    store: Store
    folder: str

    def write(self, name: str, data: bytes) -> None:
        """Write one file atomically."""
        self.store.write([(f"{self.folder}/{name}" if self.folder else name, data)])


def output_of(store: Store, folder: str = "") -> FormatOutput:
    """Return the output for the files of a format.

    Export files are not synced to the disk, because after a power failure they can be rebuilt from the native frames.
    """
    if isinstance(store, FolderStore):
        return FolderOutput(store.folder / folder)
    return StoreOutput(store, folder)


class FrameExports:
    """Feeds format writers with labelled frames, in the order of their numbers.

    Parameters
    ----------
    store : Store
        Store of the data set; each format has a subfolder.
    card : DatasetCard
        Card that lists the formats.
    ratio : tuple of int or None
        Ratio of the split, or None.
    """

    def __init__(self, store: Store, card: DatasetCard, ratio: Ratio | None) -> None:
        self._root = output_of(store)
        self._assigner = None if ratio is None else SplitAssigner(ratio, _first_split(store, card))
        names = [name for name in card.formats if name != NATIVE]
        self._writers = [find_format(name).open_writer(output_of(store, name), card) for name in names]

    def add(self, frame: LabelledFrame, *, is_kept: bool = True) -> None:
        """Add one frame; a quarantined one only takes part in the split, which must not depend on it."""
        if self._assigner is not None:
            split = self._assigner.assign(frame)
            frame = LabelledFrame(frame.number, frame.read, frame.where, split)
        if is_kept:
            for writer in self._writers:
                writer.write(frame)

    def finish(self) -> None:
        """Finish every format, and write the splits."""
        for writer in self._writers:
            writer.finish()
        if self._assigner is not None:
            self._root.write(SPLIT_NAME, split_file(self._assigner))


def _first_split(store: Store, card: DatasetCard) -> dict[int, str]:
    """Return, for a second camera, the splits of the first one's frames, so that pairs stay together."""
    if card.stereo is None or card.stereo.camera != "second" or not isinstance(store, FolderStore):
        return {}
    return read_split(store.folder.parent)


class ExportSink:
    """`FrameExports` as a sink of a capture. Frames that exist already are read from the store, in order.

    Parameters
    ----------
    store : Store
        Store of the data set.
    card : DatasetCard
        Card of the data set.
    ratio : tuple of int or None
        Ratio of training, validation and test frames; None without a split.
    existing : iterable of int, optional
        Numbers of the existing frames that a resumed capture keeps.
    """

    def __init__(
        self, store: Store, card: DatasetCard, ratio: Ratio | None, existing: Iterable[int] = ()
    ) -> None:
        self._store = store
        self._existing = deque(sorted(existing))
        self._exports = (
            FrameExports(store, card, ratio) if ratio is not None or set(card.formats) != {NATIVE} else None
        )

    def write(self, frame: CheckedFrame) -> None:
        """Take one frame."""
        if self._exports is None:
            return
        self._catch_up(frame.number)
        self._exports.add(frame_from_files(frame.number, frame.files), is_kept=not frame.reason)

    def finish(self) -> None:
        """Add the last existing frames, and finish."""
        if self._exports is not None:
            self._catch_up(None)
            self._exports.finish()

    def _catch_up(self, number: int | None) -> None:
        while self._exports is not None and self._existing and (number is None or self._existing[0] < number):
            self._exports.add(frame_from_store(self._store, self._existing.popleft()))


def frame_from_store(store: Store, number: int) -> LabelledFrame:
    """Return a frame that has been written; its files are read on access."""
    stem = f"images/{number:06d}"

    def read(ending: str) -> bytes:
        try:
            return store.read(f"{stem}.{ending}", MAX_BYTES)
        except OSError as error:
            raise UserError(
                f"{store.title}: cannot read {stem}.{ending} ({error}); run flyaround check"
            ) from error

    return LabelledFrame(number, read, f"{store.title}/{stem}")
