"""Images of eight bits out of deeper ones: what readers of most formats take every picture for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.dataset.formats.native import decode_png, encode_png
from simulator.labels.truth import Truth

if TYPE_CHECKING:
    from simulator.dataset.formats.base import FormatOutput, FormatWriter
    from simulator.dataset.formats.labelled_frame import LabelledFrame

IMAGES = ("png", "clean.png")
"""Endings of the files that hold digital numbers."""
README = "README.md"


def image_bits(frame: LabelledFrame) -> int:
    """Return the depth of a frame's digital numbers; of imported pictures that of their files."""
    truth = frame.truth
    return truth.scene.sensor.bits if isinstance(truth, Truth) else 8 * frame.image.itemsize


def scale_sentence(bits: int) -> str:
    """Say how the values of eight bits come from digital numbers of ``bits``."""
    return f"images have 8 bits: digital numbers of {bits} bits times 255 / {2**bits - 1}, rounded"


def with_eight_bits(frame: LabelledFrame) -> LabelledFrame:
    """Return a frame whose images have eight bits, full scale 255; the frame itself if they have no more."""
    bits = image_bits(frame)
    if bits <= 8:
        return frame

    def read(ending: str) -> bytes:
        data = frame.read(ending)
        if ending not in IMAGES:
            return data
        values = decode_png(data, f"{frame.where}.{ending}") * np.float32(255 / (2**bits - 1))
        return encode_png(np.rint(values).astype(np.uint8))

    return replace(frame, read=read)


class EightBitWriter:
    """A writer that hands on frames with images of eight bits, and says in ``README.md`` how they were scaled."""

    def __init__(self, writer: FormatWriter, output: FormatOutput) -> None:
        self._writer, self._output = writer, output
        self._depths: set[int] = set()

    def write(self, frame: LabelledFrame) -> None:
        """Take one frame."""
        self._depths.add(image_bits(frame))
        self._writer.write(with_eight_bits(frame))

    def finish(self) -> None:
        """Finish the format; one with a README of its own says the scale there."""
        deep = sorted(bits for bits in self._depths if bits > 8)
        if deep:
            text = "".join(f"The {scale_sentence(bits)}.\n" for bits in deep)
            self._output.write(README, text.encode())
        self._writer.finish()
