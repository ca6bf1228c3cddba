"""Conversion between formats of data sets, native or foreign."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.dataset.card import CARD_NAME, DatasetCard, card_to_json
from flyaround.simulator.dataset.formats.base import FolderOutput
from flyaround.simulator.dataset.formats.eight_bits import image_bits
from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame, frame_from_files, native_names
from flyaround.simulator.dataset.formats.registry import (
    NATIVE,
    check_formats,
    find_format,
    parse_formats,
    read_foreign,
)
from flyaround.simulator.dataset.importing import camera_of, check_grey, import_card, imported_frames
from flyaround.simulator.dataset.labelled_dataset import open_dataset
from flyaround.simulator.dataset.split import SPLIT_NAME, Ratio, SplitAssigner, split_file
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.simulator.dataset.formats.base import FormatWriter


@dataclass(frozen=True, eq=False)
class ImportSource:
    """A source of frames.

    Parameters
    ----------
    card : DatasetCard
        Card of the data set that is written.
    form : str
        Name of its format.
    frames : iterable of LabelledFrame
        Frames in order, decoded on access.
    """

    card: DatasetCard
    form: str
    frames: Iterable[LabelledFrame]


@dataclass(frozen=True)
class NativeWriter:
    """The native layout as a format."""

    output: FolderOutput
    card: DatasetCard

    def write(self, frame: LabelledFrame) -> None:
        """Write the frame's files, its record last: a record marks a complete frame."""
        for ending, data in native_names(frame):
            self.output.write(f"images/{frame.number:06d}.{ending}", data)

    def finish(self) -> None:
        """Write the card, which marks the set complete."""
        card = msgspec.structs.replace(self.card, complete=True, formats=(NATIVE,))
        self.output.write(CARD_NAME, card_to_json(card))


def open_source(
    place: Path, form: str | None = None, *, target: str | None = None, camera: str | None = None
) -> ImportSource:
    """Open the frames of a native or foreign data set.

    Parameters
    ----------
    place : Path
        Folder or list of labels of the data set.
    form : str, optional
        Format, detected by default.
    target : str, optional
        Target to use instead of that of a foreign data set.
    camera : str, optional
        Camera to use instead of that of a foreign data set.

    Returns
    -------
    ImportSource
        Frames with target and camera.

    Raises
    ------
    UserError
        If it is no readable data set, has a mistake, or does not name its target.
    """
    if form == NATIVE or (form is None and (place / CARD_NAME).is_file()):
        if target is not None or camera is not None:
            raise UserError(f"{place} defines its own target and camera; leave out --target and --camera")
        dataset = open_dataset(place)
        card = dataset.card
        if card.image_bits is None and len(dataset):  # a card of an earlier version
            card = msgspec.structs.replace(card, image_bits=image_bits(dataset[0]))
        return ImportSource(card, NATIVE, dataset)
    pictures, kind = read_foreign(place, form)
    name = target or pictures.default_target
    if not name:
        raise UserError(f"{place} does not name its target; name it with --target")
    craft, lens = load_target(name), camera_of(pictures, camera)
    if camera is None:
        check_grey(pictures)
    frames = (frame_from_files(k, files) for k, files in imported_frames(pictures, lens, craft))
    return ImportSource(import_card(pictures, lens, craft, kind), kind, frames)


def convert(
    source: ImportSource,
    folder: Path,
    form: str,
    *,
    split: Ratio | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    tell: Callable[[str], None] = lambda _sentence: None,
) -> int:
    """Write a data set's frames in one format, or in several separated by commas.

    Parameters
    ----------
    source : ImportSource
        Frames to convert.
    folder : Path
        New or empty folder; each of several formats has a subfolder.
    form : str
        Names of the formats, separated by commas.
    split : tuple of int, optional
        Shares of training, validation and test frames; by default the source's own.
    progress : callable, optional
        Called with the number done, and the total.
    tell : callable, optional
        Called before anything is written, with one sentence per format that lists the omitted labels.

    Returns
    -------
    int
        Number of frames.

    Raises
    ------
    UserError
        If a format cannot hold them, or the folder is not empty.
    """
    names = parse_formats(form)
    card = source.card if split is None else msgspec.structs.replace(source.card, split=split)
    if NATIVE in names and source.form == NATIVE:
        raise UserError("that is a native data set already; name another --format")
    for sentence in check_formats(names, card):
        tell(sentence)
    empty_folder(folder)
    outputs = {name: FolderOutput(folder / name if len(names) > 1 else folder) for name in names}
    writers: list[FormatWriter] = [
        NativeWriter(output, card) if name == NATIVE else find_format(name).open_writer(output, card)
        for name, output in outputs.items()
    ]
    assigner = None if split is None else SplitAssigner(split)
    count = 0
    for frame in source.frames:
        split_frame = frame
        if assigner is not None:
            split_frame = LabelledFrame(frame.number, frame.read, frame.where, assigner.assign(frame))
        for writer in writers:
            writer.write(split_frame)
        count += 1
        progress(count, card.n_frames)
    if assigner is not None and NATIVE in outputs:
        outputs[NATIVE].write(SPLIT_NAME, split_file(assigner))
    for writer in writers:
        writer.finish()
    return count
