"""Ground truth on an endpoint of its own: any number of loggers, none of which can slow the run."""

from __future__ import annotations

import contextlib
import socket
from typing import Any

from hil.link.errors import LinkError
from hil.link.framing import LengthFraming
from hil.link.messages import Bye, ErrorCode, ErrorMessage, Message, TruthMessage
from hil.link.packets import MAGIC, Packet
from hil.link.transport import parse_url

# a logger that lags this far behind is cut off
MAX_BACKLOG_BYTES = 8 << 20


class _Client:
    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self.backlog = bytearray()
        self.sequence = 0

    def fileno(self) -> int:
        return self.sock.fileno()


class TruthEndpoint:
    """Listens on TCP and sends TRUTH packets to whoever connected before them.

    Parameters
    ----------
    url : where loggers connect. board_url : where boards do, for one that knocks here.
    """

    def __init__(self, url: str, board_url: str) -> None:
        from hil.link.tcp import TcpListener  # noqa: PLC0415 - opens the port in the link process only

        scheme, host, port = parse_url(url)
        if scheme != "tcp":
            raise LinkError(f"the truth endpoint {url!r} must be a TCP address: write tcp://127.0.0.1:5601")
        self._listener = TcpListener(host, port)
        self.url = self._listener.url
        self._board_url = board_url
        self._framing = LengthFraming()
        self._clients: list[_Client] = []

    def fileno(self) -> int:
        """The listening socket's."""
        return self._listener.fileno()

    def accept(self) -> None:
        """Take in a logger that is knocking."""
        sock = self._listener.accept_socket(0.0)
        if sock is not None:
            sock.setblocking(False)
            self._clients.append(_Client(sock))

    def publish(self, frame_id: int, truth: dict[str, Any]) -> None:
        """Queue a frame's truth for every logger and send what the lines take."""
        self._queue(TruthMessage(frame_id, truth))

    @property
    def lagging(self) -> bool:
        """Whether something is still to be sent."""
        return any(client.backlog for client in self._clients)

    def flush(self) -> None:
        """Send what the lines take now; boards, and loggers that left or lag too far, are dropped."""
        for client in list(self._clients):
            try:
                if _is_board(client):
                    self._refuse(client)
                    continue
                while client.backlog:
                    del client.backlog[: client.sock.send(client.backlog)]
            except BlockingIOError:
                if len(client.backlog) <= MAX_BACKLOG_BYTES:
                    continue
                self._drop(client)
            except OSError:
                self._drop(client)

    def close(self) -> None:
        """Say goodbye, deliver what is queued within a second per logger, close."""
        self._queue(Bye("the run is over"))
        for client in list(self._clients):
            with contextlib.suppress(OSError):
                client.sock.settimeout(1.0)
                client.sock.sendall(client.backlog)
            self._drop(client)
        self._listener.close()

    def _queue(self, message: Message) -> None:
        for client in self._clients:
            self._append(client, message)
        self.flush()

    def _append(self, client: _Client, message: Message) -> None:
        packet = Packet(message.TYPE, message.encode(), session_id=0, sequence=client.sequence)
        client.backlog += self._framing.encode(packet)
        client.sequence += 1

    def _refuse(self, client: _Client) -> None:
        """An estimator is never handed the truth: tell its board where to go."""
        sentence = f"this port gives ground truth to loggers: connect the board to {self._board_url}"
        client.backlog.clear()
        self._append(client, ErrorMessage(ErrorCode.OTHER, sentence))
        with contextlib.suppress(OSError):
            client.sock.send(client.backlog)
        self._drop(client)

    def _drop(self, client: _Client) -> None:
        self._clients.remove(client)
        client.sock.close()


def _is_board(client: _Client) -> bool:
    """Whether it has sent a packet: loggers only listen."""
    try:
        return MAGIC in client.sock.recv(4096)
    except BlockingIOError:
        return False
