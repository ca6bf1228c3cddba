"""A line inside one process: real bytes, no sockets."""

from __future__ import annotations

import threading
from collections import deque

from flyaround.hil.link.errors import LinkClosed, LinkError
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.transports.base import Framing, StreamTransport


class _Pipe:
    """One direction of the in-process pair."""

    def __init__(self) -> None:
        self.condition = threading.Condition()
        self.data: deque[bytes] = deque()
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

    def fileno(self) -> int:
        """There is none."""
        raise LinkError("a virtual line has no file descriptor: use recv_packet with a timeout")

    def close(self) -> None:
        """Close both directions."""
        self._closed = True
        self._out.close()
        self._into.close()


def virtual_pair(*, cobs: bool = False) -> tuple[VirtualTransport, VirtualTransport]:
    """Two ends of one in-process line."""
    there, back = _Pipe(), _Pipe()
    kind = CobsFraming if cobs else LengthFraming
    return (
        VirtualTransport("virtual line, end a", there, back, kind()),
        VirtualTransport("virtual line, end b", back, there, kind()),
    )
