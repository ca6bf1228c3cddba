"""Consistent Overhead Byte Stuffing: packets as bytes without zeros, so that a zero can delimit them.

Reference: Cheshire and Baker (1999), Consistent Overhead Byte Stuffing, IEEE/ACM Trans. Networking 7(2).
"""

from __future__ import annotations

from typing import Optional

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.packet import MAX_PACKET_BYTES, Packet, decode_packet, encode_packet

try:  # C implementation, if installed
    from cobs.cobs import DecodeError
    from cobs.cobs import decode as fast_decode
    from cobs.cobs import encode as fast_encode

    HAS_FAST_COBS = True
except ImportError:
    HAS_FAST_COBS = False

# Longest COBS frame of the longest packet
_MAX_COBS_BYTES = MAX_PACKET_BYTES + MAX_PACKET_BYTES // 254 + 2


def encode(data: bytes) -> bytes:
    """Return ``data`` encoded without zero bytes: one byte longer plus at most one in 254."""
    out = bytearray()
    runs = data.split(b"\0")
    last = len(runs) - 1
    for k, run in enumerate(runs):
        start, size = 0, len(run)
        while size - start >= 254:
            out.append(0xFF)
            out += run[start : start + 254]
            start += 254
        # a full block implies "no zero follows"; at the end of the data there is none to imply
        if k < last or start < size or size == 0:
            out.append(size - start + 1)
            out += run[start:]
    return bytes(out)


def decode(data: bytes) -> bytes:
    """Return the decoded bytes.

    Raises
    ------
    PacketError
        If ``data`` holds a zero or ends inside a block.
    """
    if not data or 0 in data:
        raise PacketError("a COBS frame is empty or holds a zero byte: the line damaged it")
    out = bytearray()
    i, n = 0, len(data)
    while i < n:
        code = data[i]
        end = i + code
        if end > n:
            raise PacketError("a COBS frame ends inside a block: the line lost some bytes")
        out += data[i + 1 : end]
        i = end
        if code < 0xFF and i < n:
            out.append(0)
    return bytes(out)


class CobsFraming:
    """COBS framing with a zero byte after each packet and before the first one, for serial lines."""

    def __init__(self, *, pure: bool = False) -> None:
        self._buffer = bytearray()
        # number of leading bytes known to hold no zero, so that each byte is searched once
        self._searched = 0
        self._fast = HAS_FAST_COBS and not pure

    def encode(self, packet: Packet) -> bytes:
        """Return the bytes for the line; the leading zero ends any garbage before."""
        data = encode_packet(packet)
        stuffed = fast_encode(data) if self._fast else encode(data)
        return b"\0" + stuffed + b"\0"

    def feed(self, data: bytes) -> None:
        """Add received bytes, in pieces of any size."""
        self._buffer += data

    def next_packet(self) -> Optional[Packet]:
        """Return the next complete packet; None until more bytes arrive.

        Raises
        ------
        PacketError
            Once per damaged frame; call again for the packets after it.
        """
        while True:
            end = self._buffer.find(0, self._searched)
            if end < 0:
                self._searched = len(self._buffer)
                if self._searched > _MAX_COBS_BYTES:
                    self._buffer.clear()
                    self._searched = 0
                    raise PacketError("a serial frame has no end: the other side is not a flyaround link")
                return None
            self._searched = 0
            frame = bytes(memoryview(self._buffer)[:end])
            del self._buffer[: end + 1]
            if frame:
                return decode_packet(self._unstuff(frame))

    def _unstuff(self, frame: bytes) -> bytes:
        if not self._fast:
            return decode(frame)
        try:
            return bytes(fast_decode(frame))
        except DecodeError as error:
            raise PacketError(f"a COBS frame is damaged: {error}") from error
