"""Images of 8 bits from deeper ones, for formats whose readers expect 8 bits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.formats.native import decode_png, encode_png
from flyaround.simulator.labels.truth import Truth

if TYPE_CHECKING:
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

IMAGES = ("png", "clean.png")
"""Suffixes of the files that hold digital numbers."""


def image_bits(frame: LabelledFrame) -> int:
    """Return the bit depth of a frame's digital numbers; for imported images that of their files."""
    truth = frame.truth
    return truth.scene.sensor.bits if isinstance(truth, Truth) else 8 * frame.image.itemsize


def scale_sentence(bits: int) -> str:
    """Return a sentence on how 8-bit values follow from digital numbers of ``bits``."""
    return f"images have 8 bits: digital numbers of {bits} bits times 255 / {2**bits - 1}, rounded"


def with_eight_bits(frame: LabelledFrame) -> LabelledFrame:
    """Return a frame with 8-bit images, full scale 255; the frame itself if they are."""
    bits = image_bits(frame)
    if bits <= 8:
        return frame

    def read(ending: str) -> bytes:
        data = frame.read(ending)
        if ending not in IMAGES:
            return data
        values = decode_png(data, f"{frame.where}.{ending}") * np.float32(255 / (2**bits - 1))
        return encode_png(np.rint(values).astype(np.uint8))

    return replace(frame, read=read, decoded={})
