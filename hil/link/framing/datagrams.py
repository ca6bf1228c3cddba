"""Packets over datagrams that get lost, doubled and overtaken: fragments, selective acknowledgement. No I/O.

Each packet is cut into fragments, which a sender numbers from 0 on over the whole session. The receiver hands packets
on in order, tells what it misses, and after a while does without: the gap is reported as damage.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from enum import IntEnum
from typing import Deque, Dict, List, Optional, Sequence, Tuple, Union

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.packet import MAX_PACKET_BYTES, PROTOCOL_VERSION

MAGIC = b"FLYU"
# magic, kind, protocol version, zero, the session's token
HEAD = struct.Struct("<4sBBHQ")
# board's nonce and the host's cookie for it, 0 while unknown; a request is as long as its answer, so that no answer can
# be turned on somebody else for gain
OPEN = struct.Struct("<QQ")
# number of the fragment, its index in its packet, how many that has
DATA = struct.Struct("<QHH")
# next fragment wanted, fragments held beyond it, bytes that may be under way, the last PING's time, ranges that follow
ACK = struct.Struct("<QIIQI")
RANGE = struct.Struct("<QQ")
# number of the next new fragment, the sender's own time
PING = struct.Struct("<QQ")

LEAST_DATAGRAM_BYTES, DATAGRAM_BYTES, MOST_DATAGRAM_BYTES = 576, 1400, 65_507
# at the end of each datagram, zlib's: UDP's own has 16 bits, and a wrong number would cost more than a datagram
CRC = struct.Struct("<I")
OPEN_BYTES = HEAD.size + OPEN.size + CRC.size
FRAGMENT_OVERHEAD_BYTES = HEAD.size + DATA.size + CRC.size

SPAN = 4096
"""Fragments beyond the first missing one that a receiver keeps."""
HELD_BYTES = 2 * MAX_PACKET_BYTES
"""Bytes of fragments that a receiver keeps before their packets are whole, and of packets that nobody took."""
_PACKET_COST = 100  # what Python keeps beside the bytes
MOST_RANGES = 60
GIVE_UP_NS = 1_000_000_000
MOST_FRAGMENTS = MAX_PACKET_BYTES // (LEAST_DATAGRAM_BYTES - FRAGMENT_OVERHEAD_BYTES) + 1


class Kind(IntEnum):
    """What a datagram is."""

    OPEN = 1
    COOKIE = 2
    ACCEPT = 3
    DATA = 4
    ACK = 5
    PING = 6
    CLOSE = 7


def datagram(kind: Kind, token: int, *parts: bytes) -> bytes:
    """A datagram of a session, with its CRC."""
    data = b"".join((HEAD.pack(MAGIC, kind, PROTOCOL_VERSION, 0, token), *parts))
    return data + CRC.pack(zlib.crc32(data))


def split_datagram(data: bytes) -> Optional[Tuple[Kind, int, memoryview]]:
    """Kind, token and what follows; None for anything that is no datagram of this protocol."""
    if len(data) < HEAD.size + CRC.size:
        return None
    body = memoryview(data)
    if zlib.crc32(body[: -CRC.size]) != CRC.unpack_from(data, len(data) - CRC.size)[0]:
        return None
    magic, kind, version, _, token = HEAD.unpack_from(data)
    if magic != MAGIC or version != PROTOCOL_VERSION or not 1 <= kind <= len(Kind):
        return None
    return Kind(kind), token, body[HEAD.size : -CRC.size]


class Outgoing:
    """What was said and may have to be said again.

    Parameters
    ----------
    token : of the session. datagram_bytes : the largest datagram.
    """

    def __init__(self, token: int, datagram_bytes: int) -> None:
        self._token = token
        self._room = datagram_bytes - FRAGMENT_OVERHEAD_BYTES
        self._datagrams: Dict[int, bytes] = {}
        self._sent_ns: Dict[int, int] = {}
        self._first, self._next_new, self._end = 0, 0, 0  # oldest kept, next never sent, next to be numbered
        self._settled = 0  # fragments that the other side has, or has given up
        self.window_bytes = 1 << 16
        self.pending_bytes = 0
        self.resent = 0

    @property
    def next_number(self) -> int:
        """The first fragment that was not sent yet."""
        return self._next_new

    @property
    def is_empty(self) -> bool:
        """Whether the other side has all."""
        return self._first == self._end

    @property
    def waits(self) -> bool:
        """Whether something that was sent is not acknowledged, or waits for the window to open."""
        return not self.is_empty

    def push(self, packet: bytes) -> None:
        """Take a packet."""
        count = -(-len(packet) // self._room)
        for index in range(count):
            part = packet[index * self._room : (index + 1) * self._room]
            data = datagram(Kind.DATA, self._token, DATA.pack(self._end, index, count), part)
            self._datagrams[self._end] = data
            self.pending_bytes += len(data)
            self._end += 1

    def next_to_send(self) -> Optional[bytes]:
        """The next new datagram, where the window has room for it."""
        if self._next_new == self._end or self._next_new - self._first >= SPAN:
            return None
        under_way = (self._next_new - self._settled) * self._room
        return self._datagrams[self._next_new] if under_way < self.window_bytes else None

    def has_sent(self, at_ns: int) -> None:
        """That datagram is on its way."""
        self._sent_ns[self._next_new] = at_ns
        self._next_new += 1

    def acknowledged(
        self,
        wanted: int,
        held: int,
        missing: Sequence[Tuple[int, int]],
        at_ns: int,
        patience_ns: int,
    ) -> Tuple[bool, List[bytes]]:
        """Whether there was progress, and what to send again.

        Parameters
        ----------
        wanted : the other side has all before this. held : and so many after it. missing : first and last of each gap.
        patience_ns : what was sent less long ago may still be on its way.
        """
        if wanted > self._next_new or wanted < self._first:
            return False, []
        for number in range(self._first, wanted):
            self.pending_bytes -= len(self._datagrams.pop(number))
            del self._sent_ns[number]
        settled = min(wanted + held, self._next_new)
        progress = wanted > self._first or settled > self._settled
        self._first, self._settled = wanted, max(settled, wanted)
        again = []
        for first, last in missing:
            for number in range(max(first, wanted), min(last + 1, self._next_new)):
                if at_ns - self._sent_ns[number] >= patience_ns:
                    self._sent_ns[number] = at_ns
                    again.append(self._datagrams[number])
        self.resent += len(again)
        return progress, again


class Incoming:
    """Fragments back to packets, in the order in which they were sent.

    ``ready`` holds packets as bytes, and a `PacketError` where some are missing for good.
    """

    def __init__(self) -> None:
        self.ready: Deque[Union[bytes, PacketError]] = deque()
        self.ready_bytes = 0
        self.wanted = 0
        self.given_up = 0
        self._known_end = 0  # fragments before this one have been sent
        self._held: Dict[int, Tuple[int, int, bytes]] = {}
        self._held_bytes = 0
        self._parts: List[bytes] = []
        self._count = 0
        self._parts_bytes = 0
        self._gap_since_ns = 0

    @property
    def held(self) -> int:
        """Fragments that came before their turn."""
        return len(self._held)

    @property
    def has_gap(self) -> bool:
        """Whether a fragment that was sent has not come."""
        return self.wanted < self._known_end

    def sent_to(self, end: int, at_ns: int) -> None:
        """The other side says that it sent all fragments before ``end``."""
        if self.wanted < end <= self.wanted + SPAN and end > self._known_end:
            self._known_end = end
            self._gap_since_ns = self._gap_since_ns or at_ns

    def add(self, number: int, index: int, count: int, data: bytes, at_ns: int) -> None:
        """Take a fragment; doubled ones, and ones for which there is no room, are left out."""
        if not self.wanted <= number < self.wanted + SPAN or number in self._held or not index < count:
            return
        if self._held_bytes + len(data) > HELD_BYTES or self.ready_bytes > HELD_BYTES:
            return
        self._known_end = max(self._known_end, number + 1)
        if number != self.wanted:
            self._held[number] = (index, count, bytes(data))
            self._held_bytes += len(data)
            self._gap_since_ns = self._gap_since_ns or at_ns
            return
        self._take(index, count, data)
        self._take_held(at_ns)

    def missing(self) -> List[Tuple[int, int]]:
        """First and last of the gaps, the oldest ones."""
        gaps, at = [], self.wanted
        for number in sorted(self._held):
            if number > at:
                gaps.append((at, number - 1))
                if len(gaps) == MOST_RANGES:
                    return gaps
            at = number + 1
        if at < self._known_end:
            gaps.append((at, self._known_end - 1))
        return gaps

    def give_up(self, at_ns: int) -> bool:
        """Do without what has been missing for too long: go on with the next packet that begins."""
        if not self.has_gap or at_ns - self._gap_since_ns < GIVE_UP_NS:
            return False
        begins = [number for number, (index, _, _) in self._held.items() if index == 0]
        until = min(begins, default=self._known_end)
        for number in [n for n in self._held if n < until]:
            self._held_bytes -= len(self._held.pop(number)[2])
        self.given_up += until - self.wanted
        self._lose(f"{until - self.wanted} datagrams were lost on the line for good")
        self.wanted = until
        self._gap_since_ns = 0
        self._take_held(at_ns)
        return True

    def pop(self) -> Union[bytes, PacketError, None]:
        """The next packet, or what is missing in its place."""
        if not self.ready:
            return None
        item = self.ready.popleft()
        if isinstance(item, bytes):
            self.ready_bytes -= len(item) + _PACKET_COST
        return item

    def _take_held(self, at_ns: int) -> None:
        while self.wanted in self._held:
            index, count, data = self._held.pop(self.wanted)
            self._held_bytes -= len(data)
            self._take(index, count, data)
        # the next gap has its own time
        self._gap_since_ns = at_ns if self.has_gap else 0

    def _take(self, index: int, count: int, data: bytes) -> None:
        self.wanted += 1
        if index == 0 and self._parts:
            self._lose("a packet in datagrams ended before its end")
        self._parts_bytes += len(data)
        if index == 0:
            self._count = count
        in_turn = index == len(self._parts) and count == self._count and count <= MOST_FRAGMENTS
        if not in_turn or self._parts_bytes > MAX_PACKET_BYTES:
            if self._parts:
                self._lose("a packet in datagrams does not fit together")
            self._parts_bytes = 0
            return
        self._parts.append(data)
        if len(self._parts) == count:
            packet = b"".join(self._parts)
            self._parts, self._parts_bytes = [], 0
            self.ready.append(packet)
            self.ready_bytes += len(packet) + _PACKET_COST

    def _lose(self, sentence: str) -> None:
        self._parts, self._parts_bytes, self._count = [], 0, 0
        self.ready.append(PacketError(sentence))
