"""Enumerations that several messages share, as docs/hil_protocol.md numbers them."""

from __future__ import annotations

from enum import IntEnum

NO_FRAME = 0xFFFFFFFF


class Encoding(IntEnum):
    """How a frame's pixels travel; ``1 << value`` is its bit in ``Hello.encodings``."""

    RAW = 0
    ZSTD = 1


class Mode(IntEnum):
    """Whether the host waits for each pose or keeps the scenario's time."""

    LOCKSTEP = 0
    REALTIME = 1


class TruthPolicy(IntEnum):
    """Where ground truth goes."""

    OFF = 0
    SEPARATE = 1
    INLINE = 2


class ErrorCode(IntEnum):
    """Why an Error packet was sent."""

    OTHER = 0
    VERSION = 1
    CORRUPT = 2
    INCOMPLETE = 3
    MODEL = 4
    BUSY = 5
    FORMAT = 6
