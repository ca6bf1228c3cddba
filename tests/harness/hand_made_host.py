"""A host in a few lines, for what a board does when a host does what ours does not."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager

import numpy as np
from hil_loop import CAMERA

from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.packets.images import chunk_count, chunks, encode_image
from flyaround.hil.link.packets.messages import (
    Encoding,
    FrameHeader,
    Hello,
    HelloAck,
    PixelFormat,
    PoseMessage,
    TimeSyncRequest,
)
from flyaround.hil.link.session import Link
from flyaround.hil.link.transports.tcp import TcpListener

PATIENCE_S = 30.0


class HandMadeHost:
    """Meets boards one after the other; each has a session id of its own."""

    def __init__(self, url: str = "tcp://127.0.0.1:0") -> None:
        host, port = url[len("tcp://") :].rsplit(":", 1)
        self._listener = TcpListener(host, int(port))
        self.url = self._listener.url
        self._sessions = 0
        self.link: Link | None = None

    def meet(self, timeout_s: float = PATIENCE_S, **terms: object) -> Hello:
        """The HELLO of the next board, answered on these terms besides the usual ones."""
        transport = self._listener.accept(timeout_s)
        assert transport is not None, "no board came"
        if self.link is not None:
            self.link.transport.close()
        self._sessions += 1
        self.link = Link(transport)
        hello = self.link.recv(timeout_s)
        assert isinstance(hello, Hello)
        self.link.session_id = 100 + self._sessions
        self.link.send(HelloAck(CAMERA, 64, 48, window=1, **terms))
        return hello

    def send_frame(self, frame_id: int, level: int = 0, **fields: object) -> None:
        """A grey frame, with these fields of its header."""
        image = np.full((48, 64), level, np.uint8)
        data = encode_image(image, Encoding.RAW, PixelFormat.Mono8)
        header = FrameHeader(
            frame_id,
            64,
            48,
            8,
            Encoding.RAW,
            len(data),
            chunk_count(len(data), 1 << 18),
            0.01,
            0.1 * frame_id,
            now_ns(),
            "2026-01-01T00:00:00Z",
            **fields,
        )
        self.link.send(header)
        for chunk in chunks(frame_id, data, 1 << 18):
            self.link.send(chunk)

    def ask_clock(self) -> None:
        """Send one clock request."""
        self.link.send(TimeSyncRequest(now_ns()))

    def hear(self, kind, timeout_s: float = PATIENCE_S):
        """The next message of a kind; others are passed over."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            message = self.link.recv(0.2)
            if isinstance(message, kind):
                return message
        raise AssertionError(f"no {kind} came")

    def pose(self) -> PoseMessage:
        """The next answer."""
        return self.hear(PoseMessage)

    def vanish(self) -> None:
        """Cut the line, without a goodbye."""
        self.link.transport.close()

    def close(self) -> None:
        """Stop listening, too."""
        if self.link is not None:
            self.link.transport.close()
        self._listener.close()


def leave_with_a_goodbye(host: HandMadeHost) -> None:
    """Say goodbye behind questions whose answers nobody takes: the board can send no more when it reads it."""
    for _ in range(5):
        host.ask_clock()
    host.link.close("the run is over")


@contextmanager
def hand_made_host(url: str = "tcp://127.0.0.1:0"):
    """A host that listens."""
    host = HandMadeHost(url)
    try:
        yield host
    finally:
        host.close()


def in_thread(function, *arguments):
    """Run a function beside the test; its result comes into the list."""
    result: list = []
    thread = threading.Thread(target=lambda: result.append(function(*arguments)), daemon=True)
    thread.start()
    return thread, result
