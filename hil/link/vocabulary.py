"""Values that several messages share, and how a payload's fixed part is read."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Any, Tuple, Type, TypeVar

from hil.link.errors import PacketError
from hil.link.packets import PROTOCOL_VERSION

NO_FRAME = 0xFFFFFFFF

E = TypeVar("E", bound=IntEnum)


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


def unpack_fixed(layout: struct.Struct, data: bytes, name: str, *, tail: bool = False) -> Tuple[Any, ...]:
    """Unpack, with the payload's length checked first."""
    if len(data) < layout.size or (not tail and len(data) != layout.size):
        raise PacketError(f"a {name} payload has {len(data)} bytes, expected {layout.size}")
    return layout.unpack_from(data)


def known_value(kind: Type[E], value: int, name: str) -> E:
    """The enumeration's member; PacketError for a value of a later protocol."""
    try:
        return kind(value)
    except ValueError as error:
        raise PacketError(f"{name} {value} is unknown to link protocol {PROTOCOL_VERSION}") from error
