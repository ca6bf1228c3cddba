"""The contract of every line to one other side, and what all byte streams share: framing and deadlines."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Optional, Protocol

from flyaround.hil.link.errors import LinkClosed
from flyaround.hil.link.packets.packet import Packet


class Framing(Protocol):
    """Packets to bytes and back; see ``flyaround.hil.link.framing.length_prefix``."""

    def encode(self, packet: Packet) -> bytes:
        """Bytes for the line."""

    def feed(self, data: bytes) -> None:
        """Take bytes from the line."""

    def next_packet(self) -> Optional[Packet]:
        """The next packet, None until more bytes come; PacketError for damage."""


class Transport(Protocol):
    """A line to one other side.

    ``send_packet`` and ``recv_packet`` may be called from two different threads, one each. What a transport promises:
    a packet that arrives is whole and was sent (its CRC held). What it may not promise, and its docstring then says:
    that all packets arrive, in order, once; that the other side's leaving is noticed.

    A new transport takes a file in this folder with a class for the line and one for its `Listener`, and a scheme in
    `url`. The contract's tests run over every transport.
    """

    name: str
    chunk_bytes: int

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send with some bits of one byte of the line turned over: for runs with faults on purpose."""

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """The next packet, None after ``timeout_s``; PacketError for damage, LinkClosed at the end."""

    def be_patient(self, silence_s: float) -> None:
        """Take another side for gone only after so long; lines that ask sooner by themselves then wait longer."""

    def fileno(self) -> int:
        """What to wait on for reading."""

    def close(self) -> None:
        """Give the line back; closing twice is harmless."""


class Listener(Protocol):
    """Where the other side may connect."""

    url: str

    def accept(self, timeout_s: float) -> Optional[Transport]:
        """A line to whoever came, None after ``timeout_s``."""

    def fileno(self) -> int:
        """What to wait on for somebody to come."""

    def close(self) -> None:
        """Stop listening."""


class StreamTransport(ABC):
    """The part that all byte streams share: framing and deadlines.

    A stream's own class says how bytes are written and read, and who closes what.
    """

    # a clock request waits for one of these at most; small ones also leave the processor's cache to the other side
    chunk_bytes = 1 << 15

    def __init__(self, name: str, framing: Framing) -> None:
        self.name = name
        self._framing = framing
        self._closed = False

    def be_patient(self, silence_s: float) -> None:  # noqa: B027 - most streams ask nobody
        """Take another side for gone only after so long."""

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""
        if self._closed:
            raise LinkClosed(f"{self.name} is closed")
        self._write(self._framing.encode(packet))

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send with some bits of one byte of the line turned over: for runs with faults on purpose."""
        data = bytearray(self._framing.encode(packet))
        data[at % len(data)] ^= flip
        self._write(bytes(data))

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """The next packet, None after ``timeout_s``; PacketError for damage, LinkClosed at the end."""
        deadline = time.monotonic() + timeout_s
        while True:
            packet = self._framing.next_packet()
            if packet is not None:
                return packet
            if self._closed:
                raise LinkClosed(f"{self.name} is closed")
            left = deadline - time.monotonic()
            data = self._read(max(0.0, left))
            if data:
                self._framing.feed(data)
            if left <= 0:
                # also while bytes keep coming: a line of endless garbage holds nobody here
                return self._framing.next_packet()

    @abstractmethod
    def _write(self, data: bytes) -> None:
        """All bytes onto the line; LinkClosed at its end."""

    @abstractmethod
    def _read(self, timeout_s: float) -> bytes:
        """Bytes that are there within ``timeout_s``, none otherwise; LinkClosed at the end."""
