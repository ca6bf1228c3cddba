"""Enumerations shared by several messages, numbered as in docs/hil_protocol.md."""

from __future__ import annotations

from enum import IntEnum
from typing import Iterable, Tuple

NO_FRAME = 0xFFFFFFFF
"""Frame number of packets that belong to no frame."""


class Encoding(IntEnum):
    """Compression of a frame's pixels; ``1 << value`` is its bit in ``Hello.encodings``."""

    RAW = 0
    ZSTD = 1
    PNG = 2


class PixelFormat(IntEnum):
    """Layout of the pixels in a raw image, named and numbered by GenICam's Pixel Format Naming Convention."""

    Mono8 = 0x01080001
    Mono10 = 0x01100003
    Mono12p = 0x010C0047
    Mono16 = 0x01100007
    RGB8 = 0x02180014

    @property
    def depth_bits(self) -> int:
        """Significant bits per channel."""
        return {"Mono8": 8, "Mono10": 10, "Mono12p": 12, "Mono16": 16, "RGB8": 8}[self.name]

    @property
    def in_words(self) -> bool:
        """True if each sample of the unpacked image takes two bytes."""
        return self.depth_bits > 8

    @property
    def channels(self) -> int:
        """Number of samples per pixel."""
        return 3 if self is PixelFormat.RGB8 else 1


PIXEL_FORMATS: Tuple[PixelFormat, ...] = tuple(PixelFormat)
"""Formats in the order of their bits in ``Hello.pixel_formats``."""

GREY_FORMATS: Tuple[PixelFormat, ...] = tuple(f for f in PIXEL_FORMATS if f.channels == 1)


def format_mask(formats: Iterable[PixelFormat]) -> int:
    """Return the formats as a bit mask for ``Hello.pixel_formats``.

    Returns
    -------
    int
        Mask with bit k set for format k of ``PIXEL_FORMATS``.
    """
    return sum(1 << PIXEL_FORMATS.index(f) for f in set(formats))


def formats_in(mask: int) -> Tuple[PixelFormat, ...]:
    """Return the formats whose bits are set; unknown bits are ignored."""
    return tuple(f for k, f in enumerate(PIXEL_FORMATS) if mask >> k & 1)


class FieldTag(IntEnum):
    """Tags of the optional fields after the fixed part of a payload, for all packet types."""

    SUN_CAMERA = 1
    TRANSFER = 2
    COVARIANCE = 3


class Transfer(IntEnum):
    """Transfer function of the pixel values, like ``encoding`` of a camera file."""

    LINEAR = 0
    SRGB = 1
    GAMMA = 2


class Mode(IntEnum):
    """Pace of a session: lockstep waits for each pose, real time keeps the scenario's time."""

    LOCKSTEP = 0
    REALTIME = 1


class TruthPolicy(IntEnum):
    """Destination of the ground truth."""

    OFF = 0
    SEPARATE = 1
    INLINE = 2


class ErrorCode(IntEnum):
    """Cause of an Error packet."""

    OTHER = 0
    VERSION = 1
    CORRUPT = 2
    INCOMPLETE = 3
    MODEL = 4
    BUSY = 5
    FORMAT = 6
