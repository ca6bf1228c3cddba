"""One way to move packets, whatever the line: the Transport contract, URLs, and an in-process pair."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from typing import Deque, Optional, Protocol, Tuple
from urllib.parse import parse_qs, urlsplit

from hil.link.errors import LinkClosed, LinkError
from hil.link.framing import CobsFraming, LengthFraming
from hil.link.packets import Packet


class Framing(Protocol):
    """Packets to bytes and back; see ``hil.link.framing``."""

    def encode(self, packet: Packet) -> bytes:
        """Bytes for the line."""

    def feed(self, data: bytes) -> None:
        """Take bytes from the line."""

    def next_packet(self) -> Optional[Packet]:
        """The next packet, None until more bytes come; PacketError for damage."""


class Transport(Protocol):
    """A line to one other side.

    ``send_packet`` and ``recv_packet`` may be called from two different threads, one each.
    """

    name: str
    chunk_bytes: int

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """The next packet, None after ``timeout_s``; PacketError for damage, LinkClosed at the end."""

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
    """The part that all byte streams share: framing and deadlines."""

    chunk_bytes = 1 << 18

    def __init__(self, name: str, framing: Framing) -> None:
        self.name = name
        self._framing = framing
        self._closed = False

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""
        if self._closed:
            raise LinkClosed(f"{self.name} is closed")
        self._write(self._framing.encode(packet))

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


class _Pipe:
    """One direction of the in-process pair."""

    def __init__(self) -> None:
        self.condition = threading.Condition()
        self.data: Deque[bytes] = deque()
        self.closed = False

    def put(self, data: bytes) -> None:
        with self.condition:
            if self.closed:
                raise LinkClosed("the virtual line was closed by the other side")
            self.data.append(data)
            self.condition.notify_all()

    def get(self, timeout_s: float) -> bytes:
        with self.condition:
            self.condition.wait_for(lambda: self.data or self.closed, timeout_s)
            if self.data:
                return self.data.popleft()
            if self.closed:
                raise LinkClosed("the virtual line was closed by the other side")
            return b""

    def close(self) -> None:
        with self.condition:
            self.closed = True
            self.condition.notify_all()


class VirtualTransport(StreamTransport):
    """One end of an in-process line; real bytes, no sockets."""

    def __init__(self, name: str, out: _Pipe, into: _Pipe, framing: Framing) -> None:
        super().__init__(name, framing)
        self._out, self._into = out, into

    def _write(self, data: bytes) -> None:
        self._out.put(data)

    def _read(self, timeout_s: float) -> bytes:
        return self._into.get(timeout_s)

    def inject(self, data: bytes) -> None:
        """Put raw bytes on the line, for tests of damage."""
        self._out.put(data)

    def fileno(self) -> int:
        """There is none."""
        raise LinkError("a virtual line has no file descriptor: use recv_packet with a timeout")

    def close(self) -> None:
        """Close both directions."""
        self._closed = True
        self._out.close()
        self._into.close()


def virtual_pair(*, cobs: bool = False) -> Tuple[VirtualTransport, VirtualTransport]:
    """Two ends of one in-process line."""
    there, back = _Pipe(), _Pipe()
    kind = CobsFraming if cobs else LengthFraming
    return (
        VirtualTransport("virtual line, end a", there, back, kind()),
        VirtualTransport("virtual line, end b", back, there, kind()),
    )


def parse_url(url: str) -> Tuple[str, str, int]:
    """Scheme, host or device, and port or baud rate of a link URL.

    ``tcp://127.0.0.1:5600`` or ``serial:///dev/ttyUSB0?baud=921600``.

    Raises
    ------
    LinkError
        If the URL is neither.
    """
    parts = urlsplit(url)
    try:
        if parts.scheme == "tcp":
            if parts.hostname is None or parts.port is None:
                raise LinkError(f"link URL {url!r} lacks host or port: write tcp://127.0.0.1:5600")
            return "tcp", parts.hostname, parts.port
        if parts.scheme == "serial":
            baud = int(parse_qs(parts.query).get("baud", ["115200"])[0])
            if not parts.path or baud <= 0:
                raise LinkError(
                    f"link URL {url!r} lacks a device or baud rate: write serial:///dev/ttyUSB0?baud=921600"
                )
            return "serial", parts.path, baud
    except ValueError as error:
        raise LinkError(
            f"link URL {url!r} has a bad number ({error}): write tcp://127.0.0.1:5600"
            " or serial:///dev/ttyUSB0?baud=921600"
        ) from error
    raise LinkError(
        f"link URL {url!r} has an unknown scheme: write tcp://HOST:PORT or serial:///dev/ttyUSB0?baud=921600"
    )


def connect(url: str, timeout_s: float = 10.0) -> Transport:
    """A line to a listening host, tried until ``timeout_s`` has passed.

    Raises
    ------
    LinkError
        If the URL is bad or nobody listens there.
    """
    scheme, where, number = parse_url(url)
    if scheme == "tcp":
        from hil.link.tcp import connect_tcp  # noqa: PLC0415 - tcp builds on this module

        return connect_tcp(where, number, timeout_s)
    from hil.link.serial_port import SerialTransport  # noqa: PLC0415 - the same

    return SerialTransport(where, number)


def listen(url: str) -> Listener:
    """Listen on a URL; port 0 takes a free one, named by ``Listener.url``.

    Raises
    ------
    LinkError
        If the URL is bad or the port or device is not to be had.
    """
    scheme, where, number = parse_url(url)
    if scheme == "tcp":
        from hil.link.tcp import TcpListener  # noqa: PLC0415 - the same

        return TcpListener(where, number)
    from hil.link.serial_port import SerialListener  # noqa: PLC0415 - the same

    return SerialListener(where, number)
