"""Packets out of a stream of bytes, and how the stream is found again after damage."""

from __future__ import annotations

import struct
from typing import Optional

from hil.link import cobs as pure_cobs
from hil.link.errors import PacketError
from hil.link.packets import (
    HEADER,
    MAGIC,
    MAX_PAYLOAD_BYTES,
    OVERHEAD_BYTES,
    Packet,
    decode_packet,
    encode_packet,
)

try:  # C speed where the package is; a board does without
    from cobs.cobs import DecodeError
    from cobs.cobs import decode as fast_decode
    from cobs.cobs import encode as fast_encode

    HAS_FAST_COBS = True
except ImportError:
    HAS_FAST_COBS = False

PREFIX = struct.Struct("<I")
_PAYLOAD_LENGTH = struct.Struct("<I")
_PAYLOAD_LENGTH_AT = HEADER.size - _PAYLOAD_LENGTH.size
MAX_PACKET_BYTES = MAX_PAYLOAD_BYTES + OVERHEAD_BYTES

# the longest COBS frame of the longest packet
_MAX_COBS_BYTES = MAX_PACKET_BYTES + MAX_PACKET_BYTES // 254 + 2


class LengthFraming:
    """A u32 length before each packet (TCP).

    The prefix repeats what the packet's header says. Where the two disagree, or a CRC fails, the
    decoder looks for the next place where prefix, magic and header length fit together.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._in_garbage = False

    def encode(self, packet: Packet) -> bytes:
        """Bytes for the line."""
        data = encode_packet(packet)
        return PREFIX.pack(len(data)) + data

    def feed(self, data: bytes) -> None:
        """Take bytes from the line, however they were cut."""
        self._buffer += data

    def next_packet(self) -> Optional[Packet]:
        """The next whole packet, or None until more bytes come.

        Raises
        ------
        PacketError
            Once per stretch of damage; call again for what follows it.
        """
        buffer = self._buffer
        start = PREFIX.size
        while len(buffer) >= start + HEADER.size:
            length = PREFIX.unpack_from(buffer)[0]
            payload = _PAYLOAD_LENGTH.unpack_from(buffer, start + _PAYLOAD_LENGTH_AT)[0]
            if (
                buffer[start : start + 4] == MAGIC
                and length == payload + OVERHEAD_BYTES
                and length <= MAX_PACKET_BYTES
            ):
                if len(buffer) < start + length:
                    return None
                try:
                    packet = decode_packet(bytes(memoryview(buffer)[start : start + length]))
                except PacketError:
                    # the length itself may be what is damaged: look inside for the next packet
                    self._skip()
                    self._in_garbage = True
                    raise
                del buffer[: start + length]
                self._in_garbage = False
                return packet
            self._skip()
            if not self._in_garbage:
                self._in_garbage = True
                raise PacketError("bytes between packets were dropped: the line is out of step")
        return None

    def _skip(self) -> None:
        """Drop bytes up to the next possible packet."""
        at = self._buffer.find(MAGIC, PREFIX.size + 1)
        # keep what may be a prefix and the start of a magic
        keep_from = at - PREFIX.size if at >= 0 else max(1, len(self._buffer) - PREFIX.size - 3)
        del self._buffer[:keep_from]


class CobsFraming:
    """COBS with a zero byte after (and before the first of) each packet, for serial lines."""

    def __init__(self, *, pure: bool = False) -> None:
        self._buffer = bytearray()
        self._fast = HAS_FAST_COBS and not pure

    def encode(self, packet: Packet) -> bytes:
        """Bytes for the line; the leading zero ends whatever garbage went before."""
        data = encode_packet(packet)
        stuffed = fast_encode(data) if self._fast else pure_cobs.encode(data)
        return b"\0" + stuffed + b"\0"

    def feed(self, data: bytes) -> None:
        """Take bytes from the line, however they were cut."""
        self._buffer += data

    def next_packet(self) -> Optional[Packet]:
        """The next whole packet, or None until more bytes come.

        Raises
        ------
        PacketError
            Once per damaged frame; call again for what follows it.
        """
        while True:
            end = self._buffer.find(0)
            if end < 0:
                if len(self._buffer) > _MAX_COBS_BYTES:
                    self._buffer.clear()
                    raise PacketError("a serial frame has no end: the other side is not a flyaround link")
                return None
            frame = bytes(memoryview(self._buffer)[:end])
            del self._buffer[: end + 1]
            if frame:
                return decode_packet(self._unstuff(frame))

    def _unstuff(self, frame: bytes) -> bytes:
        if not self._fast:
            return pure_cobs.decode(frame)
        try:
            return bytes(fast_decode(frame))
        except DecodeError as error:
            raise PacketError(f"a COBS frame is damaged: {error}") from error
