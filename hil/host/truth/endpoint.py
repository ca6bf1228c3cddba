"""TCP endpoint that streams ground truth to loggers without ever delaying the run."""

from __future__ import annotations

import contextlib
import socket
import time
from typing import Any

from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.packets.messages import Bye, ErrorCode, ErrorMessage, Message, TruthMessage
from flyaround.hil.link.packets.packet import MAGIC, Packet
from flyaround.hil.link.security import HostHandshake
from flyaround.hil.link.transports.tcp import TcpListener, keep_alive
from flyaround.hil.link.transports.url import parse_url

# Maximum number of connected loggers.
MAX_CLIENTS = 16

# Limits of a logger's send queue, beyond which it is disconnected: size [bytes], and time for which it was not empty
# [ns]. They bound the host's memory per logger; larger ones forgive a logger that stalls for longer.
MAX_BACKLOG_BYTES = 8 << 20
MAX_LAG_NS = 10_000_000_000

# Time-out for a logger's proof of the key [ns].
PROOF_NS = 10_000_000_000

# Time-out for sending the queues and the goodbye at the end, for all loggers together [s].
CLOSE_S = 2.0

# Bytes taken from a logger at once, more than its proof of the key has, and pause between tries to empty a queue [s].
RECEIVE_BYTES, FLUSH_S = 4096, 0.005


class _Client:
    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self.backlog = bytearray()
        self.lagging_since_ns: int | None = None
        self.sequence = 0
        self.tail = b""  # last bytes received, in which a packet's magic number may begin
        self.peer_closed = False  # the peer closed its sending side: it disconnected, or only receives
        self.framing = LengthFraming()
        self.handshake: HostHandshake | None = None
        self.connected_ns = now_ns()

    def send(self) -> None:
        """Send as much of the queue as the socket accepts without blocking.

        Raises
        ------
        OSError
            If the client disconnected.
        """
        try:
            while self.backlog:
                del self.backlog[: self.sock.send(self.backlog)]
        except BlockingIOError:
            if self.lagging_since_ns is None:
                self.lagging_since_ns = now_ns()
        else:
            self.lagging_since_ns = None

    def is_board(self) -> bool:
        """Return True if the client sent a packet of the link: a board does, whereas loggers only receive.

        Raises
        ------
        OSError
            If the client disconnected, or its proof of the key is wrong.
        """
        try:
            data = self.sock.recv(RECEIVE_BYTES)
        except BlockingIOError:
            return False
        self.peer_closed = self.peer_closed or not data
        if self.handshake is not None:
            self._receive_proof(data, self.handshake)
            return False
        is_link_packet = MAGIC in self.tail + data
        self.tail = (self.tail + data)[-len(MAGIC) + 1 :]
        return is_link_packet

    def _receive_proof(self, data: bytes, handshake: HostHandshake) -> None:
        self.framing.feed(data)
        while True:
            try:
                packet = self.framing.next_packet()
            except PacketError:
                continue
            if packet is None:
                return
            try:
                answer = handshake.take(packet)
            except LinkClosed as error:
                raise OSError(str(error)) from error
            if answer is not None:
                self.backlog += self.framing.encode(answer)

    @property
    def is_known(self) -> bool:
        """True if the client may receive the truth: it proved knowledge of the key, or none is required."""
        return self.handshake is None or self.handshake.seal is not None


class TruthEndpoint:
    """TCP server that sends TRUTH packets to the loggers that are connected at the time.

    At most ``MAX_CLIENTS`` loggers are accepted; others are refused with an error message. A logger that disconnected,
    or lags by ``MAX_BACKLOG_BYTES`` or ``MAX_LAG_NS``, is dropped.

    Parameters
    ----------
    url : str
        Address for loggers.
    board_url : str
        Address for boards, for the error message to a board that connects here by mistake.
    key : bytes, optional
        Key that a logger must prove to know within ``PROOF_NS``; None disables authentication.

    Raises
    ------
    LinkError
        If the address is not of TCP, or not available.
    """

    def __init__(self, url: str, board_url: str, key: bytes | None = None) -> None:
        self._key = key
        scheme, host, port = parse_url(url)
        if scheme != "tcp":
            raise LinkError(f"the truth endpoint {url!r} must be a TCP address: write tcp://127.0.0.1:5601")
        self._listener = TcpListener(host, port)
        self.url = self._listener.url
        self._board_url = board_url
        self._framing = LengthFraming()
        self._clients: list[_Client] = []

    def fileno(self) -> int:
        """Return the file descriptor of the listening socket."""
        return self._listener.fileno()

    def accept(self) -> None:
        """Accept a pending connection, and refuse it if there are too many loggers."""
        sock = self._listener.accept_socket(0.0)
        if sock is None:
            return
        sock.setblocking(False)
        client = _Client(sock)
        if self._key is not None:
            client.handshake = HostHandshake(self._key)
        with contextlib.suppress(OSError):  # disconnected already: the next send fails and drops it
            keep_alive(sock)
        self._make_room()
        full = len(self._clients) >= MAX_CLIENTS
        self._clients.append(client)
        if full:
            self._refuse(
                client, ErrorCode.BUSY, f"{MAX_CLIENTS} loggers are connected already: stop one first"
            )

    def publish(self, frame_id: int, truth: dict[str, Any]) -> None:
        """Queue a frame's truth for every logger, and send without blocking."""
        self._queue(TruthMessage(frame_id, truth))

    @property
    def lagging(self) -> bool:
        """True if data is queued, or a logger has not yet proved knowledge of the key."""
        return any(client.backlog or not client.is_known for client in self._clients)

    def flush(self) -> None:
        """Send without blocking; drop boards, and loggers that disconnected or lag too far."""
        for client in list(self._clients):
            try:
                if client.is_board():
                    sentence = (
                        f"this port serves ground truth to loggers: connect the board to {self._board_url}"
                    )
                    self._refuse(client, ErrorCode.OTHER, sentence)
                    continue
                client.send()
                if not client.is_known and now_ns() - client.connected_ns >= PROOF_NS:
                    self._refuse(
                        client,
                        ErrorCode.OTHER,
                        "no proof of the key was received: give the logger --key FILE",
                    )
                    continue
            except OSError:
                self._drop(client)
                continue
            since_ns = client.lagging_since_ns
            if since_ns is not None and (
                len(client.backlog) > MAX_BACKLOG_BYTES or now_ns() - since_ns >= MAX_LAG_NS
            ):
                self._drop(client)

    def close(self, reason: str | None = "the run is over") -> None:
        """Say goodbye if there is a ``reason``, deliver the queue within ``CLOSE_S``, and close."""
        if reason is not None:
            self._queue(Bye(reason))
        deadline = time.monotonic() + CLOSE_S
        while self.lagging and time.monotonic() < deadline:
            time.sleep(FLUSH_S)
            self.flush()
        for client in list(self._clients):
            self._drop(client)
        self._listener.close()

    def _queue(self, message: Message) -> None:
        for client in self._clients:
            if client.is_known:
                self._append(client, message)
        self.flush()

    def _append(self, client: _Client, message: Message) -> None:
        packet = Packet(message.TYPE, message.encode(), session_id=0, sequence=client.sequence)
        if client.handshake is not None and client.handshake.seal is not None:
            packet = client.handshake.seal.seal(packet)
        client.backlog += self._framing.encode(packet)
        client.sequence += 1

    def _make_room(self) -> None:
        """Make room by dropping clients that disconnected, or else the oldest one without a proof of the key."""
        if len(self._clients) < MAX_CLIENTS:
            return
        self.flush()
        for client in [client for client in self._clients if client.peer_closed]:
            self._drop(client)
        unauthenticated = [client for client in self._clients if not client.is_known]
        if len(self._clients) >= MAX_CLIENTS and unauthenticated:
            self._drop(unauthenticated[0])

    def _refuse(self, client: _Client, code: ErrorCode, sentence: str) -> None:
        """Send an error message to a client and disconnect it."""
        client.backlog.clear()
        self._append(client, ErrorMessage(code, sentence))
        with contextlib.suppress(OSError):
            client.sock.send(client.backlog)
        self._drop(client)

    def _drop(self, client: _Client) -> None:
        self._clients.remove(client)
        client.sock.close()
