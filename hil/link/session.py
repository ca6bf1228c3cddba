"""Session: the opening handshake, and messages with session id and sequence on a transport."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from dataclasses import dataclass, field, replace
from typing import AbstractSet, Dict, FrozenSet, Optional, Sequence

from flyaround.hil.link.errors import (
    FormatRefused,
    LinkClosed,
    LinkError,
    PacketError,
    ProtocolMistake,
    RepeatedPacket,
    UnsealedPacket,
    VersionMismatch,
)
from flyaround.hil.link.packets.enums import formats_in
from flyaround.hil.link.packets.messages import (
    Bye,
    Encoding,
    ErrorCode,
    ErrorMessage,
    Hello,
    HelloAck,
    Message,
    PixelFormat,
    TruthPolicy,
    decode_message,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.transports.base import Transport

logger = logging.getLogger(__name__)

# Packet types accepted by each side, by the state of its session; other payloads are not parsed
HOST_BEFORE_HELLO: FrozenSet[PacketType] = frozenset({PacketType.HELLO})
_BOTH_IN_SESSION = frozenset(
    {PacketType.TIME_SYNC_REQUEST, PacketType.TIME_SYNC_REPLY, PacketType.BYE, PacketType.ERROR}
)
HOST_IN_SESSION = _BOTH_IN_SESSION | {PacketType.HELLO, PacketType.POSE, PacketType.CREDIT}
BOARD_BEFORE_TERMS: FrozenSet[PacketType] = frozenset(
    {PacketType.HELLO_ACK, PacketType.BYE, PacketType.ERROR}
)
BOARD_IN_SESSION = _BOTH_IN_SESSION | {PacketType.FRAME_HEADER, PacketType.FRAME_CHUNK}

SILENCE_S = 1.5
"""Silence after which a side that used to send regularly is considered lost [s]."""

# Number of ignored packets in a row after which a non-blocking receive returns to its caller
MAX_IGNORED = 256


@dataclass
class LinkStats:
    """Packet counts since the line was opened.

    Parameters
    ----------
    sent : int, optional
        Packets sent.
    received : int, optional
        Intact packets received.
    corrupt : int, optional
        Packets damaged on the line.
    mistakes : int, optional
        Intact packets that violate the protocol.
    sequence_gaps : int, optional
        Number of gaps in the sequence numbers of received packets.
    stale : int, optional
        Packets of an earlier session on the same line.
    kinds : dict of str to int, optional
        Protocol violations by kind.
    """

    sent: int = 0
    received: int = 0
    corrupt: int = 0
    mistakes: int = 0
    sequence_gaps: int = 0
    stale: int = 0
    kinds: Dict[str, int] = field(default_factory=dict)

    def add_mistake(self, kind: str, about: str = "") -> None:
        """Count a protocol violation of the other side. The first one of each kind is logged."""
        self.mistakes += 1
        self.kinds[kind] = self.kinds.get(kind, 0) + 1
        if about and self.kinds[kind] == 1:
            logger.warning(
                "the other side violated the link protocol: %s (%s); further ones are only counted",
                kind,
                about,
            )


class Link:
    """Messages over a transport.

    Parameters
    ----------
    transport : Transport
        Open line.
    session_id : int, optional
        Session identifier; 0 until the handshake has settled it.
    accepts : AbstractSet, optional
        Packet types that are accepted in the present state; others are counted as mistakes and not parsed.
    """

    def __init__(
        self,
        transport: Transport,
        session_id: int = 0,
        accepts: AbstractSet[PacketType] = frozenset(PacketType),
    ) -> None:
        self.transport = transport
        self.session_id = session_id
        self.accepts = accepts
        self.stats = LinkStats()
        self._lock = threading.Lock()
        self._sequence = 0
        self._peer_session = 0
        self.last_sequence: Optional[int] = None
        self.yielded = False
        """True if the last `recv` returned after ``MAX_IGNORED`` ignored packets: more may be buffered, so the caller
        must not wait on the line."""

    def send(self, message: Message) -> None:
        """Send one message. Thread-safe."""
        payload = message.encode()
        with self._lock:
            self.transport.send_packet(Packet(message.TYPE, payload, self.session_id, self._sequence))
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF
            self.stats.sent += 1

    def recv(self, timeout_s: float) -> Optional[Message]:
        """Return the next message of this session.

        Returns
        -------
        Message or None
            Decoded message; None after ``timeout_s``, or with ``yielded`` True after ``MAX_IGNORED`` ignored packets.

        Raises
        ------
        PacketError
            For damaged bytes; the link remains usable.
        ProtocolMistake
            For an intact packet that violates the protocol; the link remains usable.
        LinkClosed
            When the line is closed.
        """
        deadline = time.monotonic() + timeout_s
        self.yielded = False
        for _ in range(MAX_IGNORED):
            try:
                packet = self.transport.recv_packet(max(0.0, deadline - time.monotonic()))
                if packet is None:
                    return None
                self._count(packet)
                if self._belongs_here(packet):
                    message = decode_message(packet)
                    if packet.type == PacketType.HELLO_ACK:
                        self.session_id = packet.session_id
                    return message
            except RepeatedPacket as error:
                self.stats.add_mistake("a sealed packet that came before, or long after its time", str(error))
            except UnsealedPacket as error:
                self.stats.add_mistake("a packet without the seal of the session", str(error))
            except ProtocolMistake:
                self.stats.add_mistake("a payload that the protocol does not allow")
                raise
            except PacketError:
                self.stats.corrupt += 1
                raise
        self.yielded = True
        return None

    def _belongs_here(self, packet: Packet) -> bool:
        # HELLO opens a session, HELLO_ACK settles its id, ERROR may precede either
        opening = packet.type in (PacketType.HELLO, PacketType.HELLO_ACK, PacketType.ERROR)
        if not opening and packet.session_id != self.session_id:
            if self._peer_session != self.session_id:
                self.stats.stale += 1  # from an earlier session on the same serial line
            else:
                about = f"{packet.type.name} of session {packet.session_id:#x}"
                self.stats.add_mistake("a packet of a session that was never opened", about)
            return False
        if packet.type not in self.accepts:
            self.stats.add_mistake("a packet at the wrong time", packet.type.name)
            return False
        self._peer_session = packet.session_id
        return True

    def close(self, reason: Optional[str] = None) -> None:
        """Close the line, after a BYE if ``reason`` is given and the line still works."""
        if reason is not None:
            with contextlib.suppress(LinkClosed):  # the other side may have closed it first
                self.send(Bye(reason))
        self.transport.close()

    def _count(self, packet: Packet) -> None:
        self.stats.received += 1
        if self.last_sequence is not None and packet.sequence != (self.last_sequence + 1) & 0xFFFFFFFF:
            self.stats.sequence_gaps += 1
        self.last_sequence = packet.sequence


def answer_hello(
    hello: Hello,
    terms: HelloAck,
    *,
    encodings: Sequence[Encoding] = (),
    pixel_formats: Sequence[PixelFormat] = (),
) -> HelloAck:
    """Return the host's answer to a board: its terms, reduced to the board's capabilities.

    Parameters
    ----------
    hello : Hello
        The board's capabilities.
    terms : HelloAck
        The host's terms; ``window`` is the upper limit.
    encodings : sequence of Encoding, optional
        Encodings in the host's order of preference; raw if the board supports none.
    pixel_formats : sequence of PixelFormat, optional
        Formats that hold the host's images, in order of preference; by default that of ``terms``.

    Returns
    -------
    HelloAck
        Terms of the session.

    Raises
    ------
    LinkError
        If the board has the model of another target.
    FormatRefused
        If the board supports none of the pixel formats.
    """
    if hello.model_name and terms.target_name and hello.model_name != terms.target_name:
        raise LinkError(
            f"the board has a model of {hello.model_name!r} but the host's target is {terms.target_name!r}:"
            f" start the board with --target {terms.target_name}"
        )
    if hello.model_sha256 and terms.target_sha256 and hello.model_sha256 != terms.target_sha256:
        raise LinkError(
            f"the board's model of {hello.model_name!r} ({hello.model_sha256[:12]}) differs from the host's"
            f" ({terms.target_sha256[:12]}): write the board's model file again and copy it to the board"
        )
    preferred, accepted = pixel_formats or (terms.pixel_format,), formats_in(hello.pixel_formats)
    pixel_format = next((f for f in preferred if f in accepted), None)
    if pixel_format is None:
        raise FormatRefused(
            f"the board accepts pixels as {', '.join(f.name for f in accepted) or 'nothing'} but the host sends"
            f" {' or '.join(f.name for f in preferred)}: choose another --pixel-format, or another sensor in the"
            " scenario"
        )
    return replace(
        terms,
        encoding=next((e for e in encodings if hello.encodings & (1 << e)), Encoding.RAW),
        pixel_format=pixel_format,
        takes_fields=hello.takes_fields,
        window=max(1, min(hello.window, terms.window)),
    )


def greet_host(link: Link, hello: Hello, timeout_s: float, *, repeat_s: float = math.inf) -> HelloAck:
    """Run the board's side of the handshake.

    HELLO is repeated every ``repeat_s`` until it is answered, for lines that lose bytes. The host distinguishes a
    repetition from a restarted board by the packet's sequence number.

    Returns
    -------
    HelloAck
        Terms of the session, as received; ``link.accepts`` is set to the packets of a session.

    Raises
    ------
    LinkError
        If the host refuses, uses another version, or does not answer within ``timeout_s``.
    """
    name = link.transport.name
    link.accepts = BOARD_BEFORE_TERMS
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
                scores_itself = message.truth == TruthPolicy.INLINE
                link.accepts = BOARD_IN_SESSION | ({PacketType.TRUTH} if scores_itself else set())
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
    """Send the reason to the other side, then close."""
    with contextlib.suppress(LinkClosed):  # the other side may have disconnected
        link.send(ErrorMessage(code, sentence))
    link.transport.close()
