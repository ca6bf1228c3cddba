"""GVCP packets: commands of a controller and their acknowledgements. Big-endian, one per UDP datagram.

Layouts from public material: Wireshark's ``packet-gvcp.c`` and Aravis's ``arvgvcp.h``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

# UDP port of GVCP, and first byte of each command (GigE Vision 2.0).
PORT = 3956
KEY = 0x42
HEADER = struct.Struct(">BBHHH")

MAX_BYTES = 576
"""Largest accepted datagram without IP and UDP headers [bytes]."""

MAX_MEMORY_BYTES = 536
"""Largest size of one memory access [bytes]."""

ACKNOWLEDGE = 0x01
"""Flag of a command that requires an acknowledgement."""


class GvcpCommand(IntEnum):
    """Command of a controller; its acknowledgement has the next number."""

    DISCOVERY = 0x0002
    PACKET_RESEND = 0x0040
    READ_REGISTER = 0x0080
    WRITE_REGISTER = 0x0082
    READ_MEMORY = 0x0084
    WRITE_MEMORY = 0x0086


class Status(IntEnum):
    """Status of an acknowledgement."""

    SUCCESS = 0x0000
    NOT_IMPLEMENTED = 0x8001
    INVALID_PARAMETER = 0x8002
    INVALID_ADDRESS = 0x8003
    WRITE_PROTECT = 0x8004
    BAD_ALIGNMENT = 0x8005
    ACCESS_DENIED = 0x8006
    BUSY = 0x8007
    PACKET_UNAVAILABLE = 0x800C
    INVALID_HEADER = 0x800E


class RefusedError(Exception):
    """Command that is not executed.

    Parameters
    ----------
    status : Status
        Status of the acknowledgement.
    index : int, optional
        Index of the access that failed.
    """

    def __init__(self, status: Status, index: int = 0) -> None:
        super().__init__(status.name)
        self.status, self.index = status, index


@dataclass(frozen=True)
class GvcpRequest:
    """Command as received."""

    command: int
    request_id: int
    payload: bytes
    wants_answer: bool


@dataclass(frozen=True)
class ResendRequest:
    """Packets of a block that a receiver requests again, ``first`` to ``last`` inclusive."""

    channel: int
    block_id: int
    first: int
    last: int


def parse_request(datagram: bytes) -> GvcpRequest | None:
    """Return the command in a datagram; None for anything else, which is not answered."""
    if not HEADER.size <= len(datagram) <= MAX_BYTES:
        return None
    key, flags, command, length, request_id = HEADER.unpack_from(datagram)
    if key != KEY or length != len(datagram) - HEADER.size or request_id == 0:
        return None
    return GvcpRequest(command, request_id, datagram[HEADER.size :], bool(flags & ACKNOWLEDGE))


def acknowledge(request: GvcpRequest, payload: bytes = b"", status: Status = Status.SUCCESS) -> bytes:
    """Return the acknowledgement of a command."""
    return (
        struct.pack(">HHHH", status, (request.command + 1) & 0xFFFF, len(payload), request.request_id)
        + payload
    )


def read_addresses(payload: bytes) -> tuple[int, ...]:
    """Return the addresses of a READ_REGISTER.

    Raises
    ------
    RefusedError
        If the payload holds no address, or an incomplete one.
    """
    if not payload or len(payload) % 4:
        raise RefusedError(Status.INVALID_HEADER)
    return struct.unpack(f">{len(payload) // 4}I", payload)


def write_pairs(payload: bytes) -> list[tuple[int, int]]:
    """Return the addresses and values of a WRITE_REGISTER.

    Raises
    ------
    RefusedError
        If the payload holds no pair, or an incomplete one.
    """
    if not payload or len(payload) % 8:
        raise RefusedError(Status.INVALID_HEADER)
    return list(struct.iter_unpack(">II", payload))


def read_span(payload: bytes) -> tuple[int, int]:
    """Return the address and length of a READ_MEMORY.

    Raises
    ------
    RefusedError
        If the payload is malformed, not aligned to four bytes, or the span too long.
    """
    if len(payload) != 8:
        raise RefusedError(Status.INVALID_HEADER)
    address, reserved_and_count = struct.unpack(">II", payload)
    count = reserved_and_count & 0xFFFF
    if address % 4 or count % 4:
        raise RefusedError(Status.BAD_ALIGNMENT)
    if not 0 < count <= MAX_MEMORY_BYTES:
        raise RefusedError(Status.INVALID_PARAMETER)
    return address, count


def write_span(payload: bytes) -> tuple[int, bytes]:
    """Return the address and data of a WRITE_MEMORY.

    Raises
    ------
    RefusedError
        If the payload is malformed or not aligned to four bytes.
    """
    if len(payload) < 8:
        raise RefusedError(Status.INVALID_HEADER)
    (address,) = struct.unpack_from(">I", payload)
    data = payload[4:]
    if address % 4 or len(data) % 4:
        raise RefusedError(Status.BAD_ALIGNMENT)
    return address, data


def parse_resend(payload: bytes) -> ResendRequest:
    """Return the packets that a PACKET_RESEND requests.

    Raises
    ------
    RefusedError
        If the payload is malformed, or its range is empty.
    """
    if len(payload) != 12:
        raise RefusedError(Status.INVALID_HEADER)
    channel, block_id, first, last = struct.unpack(">HHII", payload)
    first, last = first & 0xFFFFFF, last & 0xFFFFFF
    if last < first:
        raise RefusedError(Status.INVALID_PARAMETER)
    return ResendRequest(channel, block_id, first, last)
