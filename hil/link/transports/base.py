"""Interface of a transport between host and board, with the framing and deadlines common to byte streams."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Optional, Protocol

from flyaround.hil.link.errors import LinkClosed
from flyaround.hil.link.packets.packet import Packet


class Framing(Protocol):
    """Conversion between packets and bytes; see ``flyaround.hil.link.framing.length_prefix``."""

    def encode(self, packet: Packet) -> bytes:
        """Return the bytes for the line."""

    def feed(self, data: bytes) -> None:
        """Add received bytes."""

    def next_packet(self) -> Optional[Packet]:
        """Return the next packet, or None until more bytes arrive; raise PacketError for damage."""


class Transport(Protocol):
    """Connection to one peer.

    ``send_packet`` and ``recv_packet`` may be called from two different threads, one each. Every transport guarantees
    that a received packet is complete and was sent as such, by its CRC. A transport that does not guarantee that all
    packets arrive, in order and once, or that a disconnected peer is detected, states so in its docstring.

    To add a transport, write a module in this folder with a class for the connection and one for its `Listener`, and
    add its scheme to `url`. The contract tests run over every transport.
    """

    name: str
    chunk_bytes: int

    def send_packet(self, packet: Packet) -> None:
        """Send a packet.

        Raises
        ------
        LinkClosed
            If the line is closed.
        """

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send a packet with some bits of one byte flipped, for runs with deliberate faults."""

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet.

        Returns
        -------
        Packet or None
            Complete packet with a correct CRC; None after ``timeout_s``.

        Raises
        ------
        PacketError
            If it is damaged.
        LinkClosed
            At the end of the stream.
        """

    def set_silence_limit(self, silence_s: float) -> None:
        """Set the silence after which the other side is considered lost; keep-alives adapt to it."""

    def fileno(self) -> int:
        """Return the file descriptor to wait on for reading.

        Returns
        -------
        int
            Descriptor that becomes readable when bytes arrive; complete packets may be buffered already.
        """

    def close(self) -> None:
        """Release the line. Closing twice is allowed."""


class Listener(Protocol):
    """Listening address at which peers connect."""

    url: str

    def accept(self, timeout_s: float) -> Optional[Transport]:
        """Return a line to a new peer.

        Returns
        -------
        Transport or None
            Line to the peer, from which nothing has been read yet; None after ``timeout_s``.
        """

    def fileno(self) -> int:
        """Return the file descriptor to wait on for a peer.

        Returns
        -------
        int
            Descriptor that becomes readable when a peer connects.
        """

    def close(self) -> None:
        """Stop listening."""


class WrappedTransport:
    """Transport that hands everything to another one; subclasses change a part of it.

    Parameters
    ----------
    line : Transport
        Transport that does the work.
    """

    def __init__(self, line: Transport) -> None:
        self._line = line
        self.name, self.chunk_bytes = line.name, line.chunk_bytes

    def send_packet(self, packet: Packet) -> None:
        """Send a packet."""
        self._line.send_packet(packet)

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send a packet with some bits of one byte flipped."""
        self._line.send_damaged(packet, at, flip)

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet, or None after ``timeout_s``."""
        return self._line.recv_packet(timeout_s)

    def set_silence_limit(self, silence_s: float) -> None:
        """Set the silence after which the other side is considered lost."""
        self._line.set_silence_limit(silence_s)

    def fileno(self) -> int:
        """Return the file descriptor to wait on."""
        return self._line.fileno()

    def close(self) -> None:
        """Close the line."""
        self._line.close()


class StreamTransport(ABC):
    """Framing and deadlines common to byte streams.

    Subclasses implement reading and writing of bytes, and closing.
    """

    # size of one chunk of a frame: a clock request waits for at most one chunk
    chunk_bytes = 1 << 15

    def __init__(self, name: str, framing: Framing) -> None:
        self.name = name
        self._framing = framing
        self._closed = False

    def set_silence_limit(self, silence_s: float) -> None:  # noqa: B027 - optional
        """Set the silence after which the other side is considered lost."""

    def send_packet(self, packet: Packet) -> None:
        """Send a packet.

        Raises
        ------
        LinkClosed
            If the line is closed.
        """
        if self._closed:
            raise LinkClosed(f"{self.name} is closed")
        self._write(self._framing.encode(packet))

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send a packet with some bits of one byte flipped, for runs with deliberate faults."""
        data = bytearray(self._framing.encode(packet))
        data[at % len(data)] ^= flip
        self._write(bytes(data))

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet, or None after ``timeout_s``.

        Raises
        ------
        PacketError
            If it is damaged.
        LinkClosed
            At the end of the stream.
        """
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
                # checked even while bytes arrive: endless garbage must not block the caller
                return self._framing.next_packet()

    @abstractmethod
    def _write(self, data: bytes) -> None:
        """Write all bytes to the line; raise LinkClosed at its end."""

    @abstractmethod
    def _read(self, timeout_s: float) -> bytes:
        """Return the bytes available within ``timeout_s``, if any; raise LinkClosed at the end."""
