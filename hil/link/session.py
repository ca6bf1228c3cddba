"""A session: the handshake that opens it, and messages with session id and sequence on a transport."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from dataclasses import dataclass, replace
from typing import Optional

from hil.link.errors import LinkClosed, LinkError, PacketError, VersionMismatch
from hil.link.messages import (
    Bye,
    Encoding,
    ErrorCode,
    ErrorMessage,
    Hello,
    HelloAck,
    Message,
    decode_message,
)
from hil.link.packets import Packet, PacketType
from hil.link.transport import Transport


@dataclass
class LinkStats:
    """Counts since the line was opened."""

    sent: int = 0
    received: int = 0
    corrupt: int = 0
    sequence_gaps: int = 0
    stale: int = 0


class Link:
    """Messages over a transport.

    Parameters
    ----------
    transport : an open line.
    session_id : 0 until the handshake has settled it.
    """

    def __init__(self, transport: Transport, session_id: int = 0) -> None:
        self.transport = transport
        self.session_id = session_id
        self.stats = LinkStats()
        self._lock = threading.Lock()
        self._sequence = 0
        self.last_sequence: Optional[int] = None

    def send(self, message: Message) -> None:
        """Send one message; threads may share this."""
        payload = message.encode()
        with self._lock:
            self.transport.send_packet(Packet(message.TYPE, payload, self.session_id, self._sequence))
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF
            self.stats.sent += 1

    def recv(self, timeout_s: float) -> Optional[Message]:
        """The next message of this session, None after ``timeout_s``.

        Raises
        ------
        PacketError
            For damaged bytes; the link stays usable.
        LinkClosed
            When the line has ended.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                packet = self.transport.recv_packet(max(0.0, deadline - time.monotonic()))
                if packet is None:
                    return None
                message = decode_message(packet)
            except PacketError:
                self.stats.corrupt += 1
                raise
            self._count(packet)
            # HELLO opens a session, HELLO_ACK settles its id, ERROR may come before either
            opening = packet.type in (PacketType.HELLO, PacketType.HELLO_ACK, PacketType.ERROR)
            if opening or packet.session_id == self.session_id:
                if packet.type == PacketType.HELLO_ACK:
                    self.session_id = packet.session_id
                return message
            self.stats.stale += 1  # of an earlier session on the same serial line

    def close(self, reason: Optional[str] = None) -> None:
        """Close the line, after a BYE when ``reason`` is given and the line still works."""
        if reason is not None:
            with contextlib.suppress(LinkClosed):  # the other side may have been faster
                self.send(Bye(reason))
        self.transport.close()

    def _count(self, packet: Packet) -> None:
        self.stats.received += 1
        if self.last_sequence is not None and packet.sequence != (self.last_sequence + 1) & 0xFFFFFFFF:
            self.stats.sequence_gaps += 1
        self.last_sequence = packet.sequence


def answer_hello(hello: Hello, terms: HelloAck, *, compress: bool) -> HelloAck:
    """The host's answer to a board: its terms, cut to what the board can do.

    Parameters
    ----------
    hello : what the board offers.
    terms : what the host wants; ``window`` is its upper limit.
    compress : whether to use zstd where both sides have it.

    Raises
    ------
    LinkError
        If the board carries another target's model.
    """
    if hello.model_name and terms.target_name and hello.model_name != terms.target_name:
        raise LinkError(
            f"the board carries a model of {hello.model_name!r} but the host flies {terms.target_name!r}:"
            f" start the board with --target {terms.target_name}"
        )
    if hello.model_sha256 and terms.target_sha256 and hello.model_sha256 != terms.target_sha256:
        raise LinkError(
            f"the board's model of {hello.model_name!r} ({hello.model_sha256[:12]}) is not the one the host"
            f" flies ({terms.target_sha256[:12]}): write the board's model file anew and copy it to the board"
        )
    zstd = compress and bool(hello.encodings & (1 << Encoding.ZSTD))
    return replace(
        terms,
        encoding=Encoding.ZSTD if zstd else Encoding.RAW,
        window=max(1, min(hello.window, terms.window)),
    )


def greet_host(link: Link, hello: Hello, timeout_s: float, *, repeat_s: float = math.inf) -> HelloAck:
    """The board's half of the handshake.

    HELLO is repeated every ``repeat_s`` while no answer comes, for lines that lose bytes; the host tells
    a repetition from a restarted board by the packet's sequence number.

    Raises
    ------
    LinkError
        If the host refuses, speaks another version, or does not answer in ``timeout_s``.
    """
    name = link.transport.name
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        link.send(hello)
        repeat = min(deadline, time.monotonic() + repeat_s)
        while time.monotonic() < repeat:
            try:
                message = link.recv(max(0.0, repeat - time.monotonic()))
            except VersionMismatch as error:
                raise LinkError(f"{name}: {error}") from error
            except PacketError:
                continue
            if isinstance(message, HelloAck):
                return message
            if isinstance(message, ErrorMessage):
                raise LinkError(f"the host at {name} refuses: {message.text}")
            if isinstance(message, Bye):
                raise LinkClosed(f"the host at {name} ended the session: {message.reason}")
    raise LinkError(
        f"{name} is open but no flyaround host answers on it (waited {timeout_s:g} s): check the port,"
        " and that the host is not busy with another board"
    )


def refuse(link: Link, code: ErrorCode, sentence: str) -> None:
    """Tell the other side why, then close."""
    with contextlib.suppress(LinkClosed):  # it may not have waited to hear it
        link.send(ErrorMessage(code, sentence))
    link.transport.close()
