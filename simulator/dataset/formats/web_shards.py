"""WebDataset: ``SPLIT-NNNNNN.tar``, each with the native files of some frames, and the card.

A sample's key is the frame's number; its fields are the native endings: ``png``, ``mask.png``, ``json``, ``depth.exr``.

References
----------
https://github.com/webdataset/webdataset
"""

from __future__ import annotations

import io
import tarfile
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.card import CARD_NAME, card_to_json
from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter
from flyaround.simulator.dataset.formats.labelled_frame import native_names
from flyaround.simulator.dataset.formats.shards import Shards

if TYPE_CHECKING:
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

Files = list[tuple[str, bytes]]


class WebWriter:
    """Writer of data sets in the WebDataset format."""

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        self._shards: Shards[Files] = Shards(self._shard)

    def write(self, frame: LabelledFrame) -> None:
        """Write the frame's files into a shard of its split."""
        files = [(f"{frame.number:06d}.{ending}", data) for ending, data in native_names(frame)]
        self._shards.add(frame.split or "train", files, sum(len(data) for _, data in files))

    def _shard(self, split: str, number: int, items: list[Files]) -> None:
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as tar:
            for name, data in (file for files in items for file in files):
                # neither time nor owner, so that the same frames give the same bytes
                info = tarfile.TarInfo(name)
                info.size = len(data)
                tar.addfile(info, io.BytesIO(data))
        self._output.write(f"{split}-{number:06d}.tar", buffer.getvalue())

    def finish(self) -> None:
        """Write the last shards, and the card."""
        self._shards.finish()
        self._output.write(CARD_NAME, card_to_json(self._card))


def _webdataset(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return WebWriter(output, card)


WEBDATASET = DatasetFormat(
    name="webdataset",
    title="WebDataset",
    carries="all files of the native layout",
    writer=_webdataset,
)
