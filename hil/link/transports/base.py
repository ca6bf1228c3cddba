"""Protocol of a line to one other side, and the framing and deadlines that all byte streams share."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Optional, Protocol

from flyaround.hil.link.errors import LinkClosed
from flyaround.hil.link.packets.packet import Packet


class Framing(Protocol):
    """Conversion of packets to bytes and back; see ``flyaround.hil.link.framing.length_prefix``."""

    def encode(self, packet: Packet) -> bytes:
        """Return the bytes for the line."""

    def feed(self, data: bytes) -> None:
        """Add bytes from the line."""

    def next_packet(self) -> Optional[Packet]:
        """Return the next packet, None until more bytes come; raise PacketError for damage."""


class Transport(Protocol):
    """Line to one other side.

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
        """Send with some bits of one byte flipped, for runs with deliberate faults."""

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet, None after ``timeout_s``; raise PacketError for damage, LinkClosed at the end."""

    def be_patient(self, silence_s: float) -> None:
        """Set the time without a sign of life after which the other side is considered gone; keep-alives follow it."""

    def fileno(self) -> int:
        """Return the file descriptor to wait on for reading."""

    def close(self) -> None:
        """Release the line; closing twice is harmless."""


class Listener(Protocol):
    """Place where the other side may connect."""

    url: str

    def accept(self, timeout_s: float) -> Optional[Transport]:
        """Return a line to a new peer, None after ``timeout_s``."""

    def fileno(self) -> int:
        """Return the file descriptor to wait on for a peer."""

    def close(self) -> None:
        """Stop listening."""


class StreamTransport(ABC):
    """Framing and deadlines that all byte streams share.

    A stream's own class says how bytes are written and read, and who closes what.
    """

    # a clock request waits for one of these at most; small ones also leave the processor's cache to the other side
    chunk_bytes = 1 << 15

    def __init__(self, name: str, framing: Framing) -> None:
        self.name = name
        self._framing = framing
        self._closed = False

    def be_patient(self, silence_s: float) -> None:  # noqa: B027 - optional
        """Set the time without a sign of life after which the other side is considered gone."""

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""
        if self._closed:
            raise LinkClosed(f"{self.name} is closed")
        self._write(self._framing.encode(packet))

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send with some bits of one byte flipped, for runs with deliberate faults."""
        data = bytearray(self._framing.encode(packet))
        data[at % len(data)] ^= flip
        self._write(bytes(data))

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet, None after ``timeout_s``; raise PacketError for damage, LinkClosed at the end."""
        deadline = time.monotonic() + timeout_s
        while True:
            packet = self._framing.next_packet()
            if packet is not None:
                return packet
            if self._closed:
                raise LinkClosed(f"{self.name} is closed")
            left_s = deadline - time.monotonic()
            data = self._read(max(0.0, left_s))
            if data:
                self._framing.feed(data)
            if left_s <= 0:
                # also while bytes keep coming: endless garbage must not block the caller
                return self._framing.next_packet()

    @abstractmethod
    def _write(self, data: bytes) -> None:
        """Write all bytes to the line; raise LinkClosed at its end."""

    @abstractmethod
    def _read(self, timeout_s: float) -> bytes:
        """Return the bytes available within ``timeout_s``, none otherwise; raise LinkClosed at the end."""
