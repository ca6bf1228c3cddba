"""The interface of a data-set format: its contents, reader and writer."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from flyaround.simulator.dataset.formats.eight_bits import image_bits, scale_sentence, with_eight_bits
from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.dataset.formats.posed_pictures import PosedPictures


class FormatOutput(Protocol):
    """Output of a writer: whole files by name, with ``/`` between folders."""

    def write(self, name: str, data: bytes) -> None:
        """Write one file; replaces a file of that name."""


@runtime_checkable
class ArraysOutput(FormatOutput, Protocol):
    """Output that receives a file's arrays before encoding, for comparison."""

    def write_arrays(self, name: str, arrays: dict[str, NDArray[Any]]) -> None:
        """Take the arrays of one file, by name."""


class FormatWriter(Protocol):
    """A writer that takes labelled frames in order, and finally writes the files that concern all of them."""

    def write(self, frame: LabelledFrame) -> None:
        """Take one frame."""

    def finish(self) -> None:
        """Write lists, last shards and the format's own card."""


@dataclass(frozen=True)
class FolderOutput:
    """Files within a folder."""

    folder: Path

    def write(self, name: str, data: bytes) -> None:
        """Write one file atomically.

        Raises
        ------
        UserError
            If the disk is full or the folder cannot be written.
        """
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, data)


class EightBitWriter:
    """Writer that passes on frames with 8-bit images, and documents the scaling in ``README.md``."""

    def __init__(self, writer: FormatWriter, output: FormatOutput) -> None:
        self._writer, self._output = writer, output
        self._depths: set[int] = set()

    def write(self, frame: LabelledFrame) -> None:
        """Take one frame."""
        self._depths.add(image_bits(frame))
        self._writer.write(with_eight_bits(frame))

    def finish(self) -> None:
        """Finish the format, and write the scaling to its README."""
        deep = sorted(bits for bits in self._depths if bits > 8)
        if deep:
            text = "".join(f"The {scale_sentence(bits)}.\n" for bits in deep)
            self._output.write("README.md", text.encode())
        self._writer.finish()


def encoding_key(camera: Camera) -> dict[str, str]:
    """Return the key that names the transfer function of a camera's images; empty if they are linear."""
    encoding = camera.pixel_encoding
    return {} if encoding == "linear" else {"encoding": encoding}


@dataclass(frozen=True, kw_only=True)
class DatasetFormat:
    """One format.

    Parameters
    ----------
    name : str
        Name on the command line, and of the folder next to the native layout.
    title : str
        Description.
    carries : str, optional
        Labels that the format holds, as part of a sentence.
    lacks : str, optional
        Labels that the format omits, as part of a sentence.
    writer : callable, optional
        Function that makes a writer from output and card; None for a read-only format.
    read : callable, optional
        Function that returns the images and poses of a folder or list, or None if it is in another format. None for a
        write-only format.
    problem : callable, optional
        Function that returns why a data set cannot be written in this format, or None.
    needs : tuple of str, optional
        Module required for writing, and the extra that installs it.
    deep_images : bool, optional
        True if its readers accept images of more than eight bits.
    """

    name: str
    title: str
    carries: str = ""
    lacks: str = ""
    writer: Callable[[FormatOutput, DatasetCard], FormatWriter] | None = None
    read: Callable[[Path], PosedPictures | None] | None = None
    problem: Callable[[DatasetCard], str | None] | None = None
    needs: tuple[str, str] | None = None
    deep_images: bool = False

    def sentence(self, card: DatasetCard) -> str:
        """Return a sentence on the contents that the format keeps of a data set, and those that it omits.

        Returns
        -------
        str
            Sentence for the user.
        """
        omission = f", without {self.lacks}" if self.lacks else ""
        bits = card.image_bits or 8
        scaling = f"; its {scale_sentence(bits)}" if bits > 8 and not self.deep_images else ""
        encoding = card.camera.pixel_encoding
        encoded = "" if encoding == "linear" else f"; its numbers are {encoding}-encoded"
        return f"{self.name} holds {self.carries}{omission}{scaling}{encoded}"

    def open_writer(self, output: FormatOutput, card: DatasetCard) -> FormatWriter:
        """Open the writer of a data set.

        Returns
        -------
        FormatWriter
            Writer to which each frame is given in order.

        Raises
        ------
        UserError
            If the format cannot hold the data set; see `check`.
        """
        self.check(card)
        if self.writer is None:
            raise RuntimeError(f"format {self.name} has no writer")
        writer = self.writer(output, card)
        return writer if self.deep_images else EightBitWriter(writer, output)

    def check(self, card: DatasetCard) -> None:
        """Raise if this format cannot hold a data set.

        Raises
        ------
        UserError
            If it is read-only, cannot hold this data set, or a required library is not installed.
        """
        if self.writer is None:
            raise UserError(f"format {self.name} can only be read; choose another with --format")
        reason = None if self.problem is None else self.problem(card)
        if reason is not None:
            raise UserError(f"format {self.name} cannot hold this data set: {reason}")
        if self.needs is not None:
            import_needed(*self.needs, self.name)


def import_needed(module: str, extra: str, name: str) -> Any:  # noqa: ANN401 - a module has what it has
    """Import a library that a format needs.

    Raises
    ------
    UserError
        If it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_extra(f"format {name}", extra, error) from error


def lens_problem(card: DatasetCard) -> str | None:
    """Return why a format of pinhole cameras cannot hold a data set, or None."""
    model = card.camera.distortion.model
    if card.camera.distortion.is_none:
        return None
    return f"its cameras are pinholes, and this one's lens distorts ({model}); capture with --camera speed, for example"


def fisheye_problem(card: DatasetCard) -> str | None:
    """Return why a format of Brown-Conrady lenses cannot hold a data set, or None."""
    if card.camera.distortion.model != "kannala_brandt":
        return None
    return "its lenses are Brown-Conrady's, and this one is a fish-eye (kannala_brandt)"


def keypoint_problem(card: DatasetCard) -> str | None:
    """Return why a format of keypoints cannot hold a data set, or None."""
    return None if card.target.keypoints else f"target {card.target.name} has no keypoints"
