"""Packet: a fixed little-endian header, a payload, and a CRC-32 over both."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

from flyaround.hil.link.errors import PacketError, ProtocolMistake, VersionMismatch

MAGIC = b"FLYA"
PROTOCOL_VERSION = 2  # of docs/hil_protocol.md; peers with different versions refuse each other

# Fields: magic, version, type, flags (zero), session id, sequence, payload length
HEADER = struct.Struct("<4sHBBQII")
CRC = struct.Struct("<I")
OVERHEAD_BYTES = HEADER.size + CRC.size

# Largest payload [bytes], so that a damaged length neither blocks a receiver nor exhausts its memory
MAX_PAYLOAD_BYTES = 1 << 22
MAX_PACKET_BYTES = MAX_PAYLOAD_BYTES + OVERHEAD_BYTES


class PacketType(IntEnum):
    """Type of the payload; see ``flyaround.hil.link.packets.messages``."""

    HELLO = 1
    HELLO_ACK = 2
    TIME_SYNC_REQUEST = 3
    TIME_SYNC_REPLY = 4
    FRAME_HEADER = 5
    FRAME_CHUNK = 6
    POSE = 7
    CREDIT = 8
    TRUTH = 9
    BYE = 10
    ERROR = 11
    AUTH_REQUEST = 12
    AUTH_CHALLENGE = 13
    AUTH_PROOF = 14


@dataclass(frozen=True)
class Packet:
    """Packet with its payload as bytes.

    Parameters
    ----------
    type : PacketType
        Type of the payload.
    payload : bytes
        Bytes of the payload.
    session_id : int, optional
        Session identifier, chosen by the host; 0 before the handshake is complete.
    sequence : int, optional
        Counter of the sender's packets, modulo 2**32.
    version : int, optional
        Protocol version of the sender.
    """

    type: PacketType
    payload: bytes
    session_id: int = 0
    sequence: int = 0
    version: int = PROTOCOL_VERSION


def encode_packet(packet: Packet) -> bytes:
    """Encode a packet as bytes.

    Returns
    -------
    bytes
        Header, payload and CRC-32 of both; the sequence number modulo 2**32.

    Raises
    ------
    PacketError
        If the payload is longer than ``MAX_PAYLOAD_BYTES``.
    """
    if len(packet.payload) > MAX_PAYLOAD_BYTES:
        raise PacketError(
            f"a {packet.type.name} payload of {len(packet.payload)} bytes exceeds the link's limit of"
            f" {MAX_PAYLOAD_BYTES}: send it in smaller chunks"
        )
    header = HEADER.pack(
        MAGIC,
        packet.version,
        packet.type,
        0,
        packet.session_id,
        packet.sequence & 0xFFFFFFFF,
        len(packet.payload),
    )
    crc = zlib.crc32(packet.payload, zlib.crc32(header))
    return b"".join((header, packet.payload, CRC.pack(crc)))


def decode_packet(data: bytes) -> Packet:
    """Return the packet in ``data``, which must hold nothing else.

    The CRC is checked before any field is used, and the version next: header layout and CRC are the same in all
    versions of the protocol, so that another version can be distinguished from damage.

    Raises
    ------
    PacketError
        If the bytes are damaged, truncated or too long.
    VersionMismatch
        If they are an intact packet of another protocol version.
    ProtocolMistake
        If they are an intact packet of an unknown type.
    """
    if len(data) < OVERHEAD_BYTES:
        raise PacketError(f"{len(data)} bytes are too short for a packet: bytes were lost on the line")
    magic, version, kind, _flags, session_id, sequence, length = HEADER.unpack_from(data)
    if magic != MAGIC or length != len(data) - OVERHEAD_BYTES:
        raise PacketError(f"{len(data)} bytes do not form a packet: the line is out of sync")
    view = memoryview(data)
    (crc,) = CRC.unpack_from(data, len(data) - CRC.size)
    if zlib.crc32(view[: -CRC.size]) != crc:
        raise PacketError(f"a packet of {len(data)} bytes failed its CRC-32: the line damaged it")
    if version != PROTOCOL_VERSION:
        raise VersionMismatch(
            f"the other side uses link protocol {version}, this one {PROTOCOL_VERSION}:"
            " install the same version of flyaround on host and board"
        )
    try:
        packet_type = PacketType(kind)
    except ValueError as error:
        raise ProtocolMistake(f"packet type {kind} is unknown to link protocol {PROTOCOL_VERSION}") from error
    return Packet(packet_type, bytes(view[HEADER.size : -CRC.size]), session_id, sequence, version)
