"""Length-prefixed packets from a byte stream, with resynchronisation after damage."""

from __future__ import annotations

import struct
from typing import Optional

from flyaround.hil.link.errors import PacketError, ProtocolMistake, VersionMismatch
from flyaround.hil.link.packets.packet import (
    HEADER,
    MAGIC,
    MAX_PACKET_BYTES,
    OVERHEAD_BYTES,
    Packet,
    decode_packet,
    encode_packet,
)

PREFIX = struct.Struct("<I")
_PAYLOAD_LENGTH = struct.Struct("<I")
_PAYLOAD_LENGTH_AT = HEADER.size - _PAYLOAD_LENGTH.size


class LengthFraming:
    """Framing with a u32 length before each packet, for TCP.

    The prefix repeats the length in the packet's header. If the two disagree or a CRC fails, the decoder searches for
    the next position where prefix, magic and header length agree.

    A packet with a wrong CRC is searched for other packets, because its length may be the damaged part. To bound the
    cost of nested fakes, each received byte pays for ``REREAD`` bytes of failed packets; beyond that a failed packet
    is dropped completely.
    """

    REREAD = 2

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._in_garbage = False
        self._failed_until = 0  # end of the bytes of packets whose failure was reported
        self._credit = self.REREAD * MAX_PACKET_BYTES  # bytes of failed packets that may be read again

    def encode(self, packet: Packet) -> bytes:
        """Encode a packet for the line.

        Returns
        -------
        bytes
            Length as u32, little-endian, and the packet from header to CRC.
        """
        data = encode_packet(packet)
        return PREFIX.pack(len(data)) + data

    def feed(self, data: bytes) -> None:
        """Add received bytes, in pieces of any size."""
        self._buffer += data
        self._credit = min(self._credit + self.REREAD * len(data), self.REREAD * MAX_PACKET_BYTES)

    def next_packet(self) -> Optional[Packet]:
        """Return the next complete packet.

        Returns
        -------
        Packet or None
            Packet with a correct CRC; None until more bytes arrive.

        Raises
        ------
        PacketError
            Once per damaged section, and for each failed packet; call again for the packets after it.
        """
        buffer, offset = self._buffer, 0
        try:
            while len(buffer) - offset >= PREFIX.size + HEADER.size:
                length = self._claimed_length(offset)
                begin, end = offset + PREFIX.size, offset + PREFIX.size + length
                damage: Optional[PacketError] = None
                if length:
                    if len(buffer) < end:
                        return None
                    try:
                        packet = decode_packet(bytes(memoryview(buffer)[begin:end]))
                    except (VersionMismatch, ProtocolMistake):
                        offset, self._in_garbage = end, False  # intact: do not search inside
                        raise
                    except PacketError as error:
                        damage = error if offset >= self._failed_until else None
                        self._failed_until = max(end, self._failed_until)
                    else:
                        offset, self._in_garbage = end, False
                        return packet
                offset = self._next_candidate(offset, length)
                if damage is None and not self._in_garbage:
                    damage = PacketError("bytes between packets were dropped: the line is out of step")
                self._in_garbage = True
                if damage is not None:
                    raise damage
            return None
        finally:
            del buffer[:offset]
            self._failed_until = max(0, self._failed_until - offset)

    def _claimed_length(self, offset: int) -> int:
        """Return the size of the packet whose prefix may be at ``offset``; 0 unless prefix, magic and header agree."""
        begin = offset + PREFIX.size
        if not self._buffer.startswith(MAGIC, begin):
            return 0
        length = int(PREFIX.unpack_from(self._buffer, offset)[0])
        payload = _PAYLOAD_LENGTH.unpack_from(self._buffer, begin + _PAYLOAD_LENGTH_AT)[0]
        return length if length == payload + OVERHEAD_BYTES and length <= MAX_PACKET_BYTES else 0

    def _next_candidate(self, offset: int, failed: int) -> int:
        """Return the next possible position of a prefix; inside the ``failed`` bytes only while credit lasts."""
        inside = failed <= self._credit
        if inside:
            self._credit -= failed
        magic = self._buffer.find(MAGIC, offset + PREFIX.size + (1 if inside else failed))
        # keep what may be a prefix and the start of a magic
        return magic - PREFIX.size if magic >= 0 else max(offset + 1, len(self._buffer) - PREFIX.size - 3)
