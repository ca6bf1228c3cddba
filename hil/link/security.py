"""Authentication by a pre-shared key: each side proves that it has the key, and each packet carries a one-time MAC.

Mutual challenge-response in three passes (after ISO/IEC 9798-4), with HMAC-SHA-256 (RFC 2104):

    board -> host  AUTH_REQUEST    board's nonce (32)
    host -> board  AUTH_CHALLENGE  host's nonce (32), HMAC(key, "flyaround host"  | both nonces) (32)
    board -> host  AUTH_PROOF      HMAC(key, "flyaround board" | both nonces) (32)

Each direction then uses its own key, HMAC(key, "flyaround to board" or "flyaround to host" | both nonces). A sealed
packet's payload ends with a counter (u64) and the first 16 bytes of HMAC(key, version, type, session, sequence,
payload, counter). A counter that was received before, or is older than the last 1024, is refused. Nothing is
encrypted.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import stat
import struct
import time
from dataclasses import replace
from typing import Callable, Optional, Tuple

from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError, RepeatedPacket, UnsealedPacket
from flyaround.hil.link.packets.messages import ErrorCode, ErrorMessage, decode_message
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.transports.base import Transport, WrappedTransport

# Sizes of nonces and proofs, and of the authentication code of each packet [bytes]: SHA-256's output, and half of it,
# the shortest truncation that RFC 2104, section 5, recommends.
NONCE_BYTES = PROOF_BYTES = 32
MAC_BYTES = 16
COUNTER = struct.Struct("<Q")
TRAILER_BYTES = COUNTER.size + MAC_BYTES

WINDOW = 1024
"""Largest reordering of packets that is accepted on lines that may reorder."""

# Allowed size of a key file [bytes].
MIN_KEY_BYTES, MAX_KEY_BYTES = 16, 4096

# Time-out for the host's proof [s], and interval at which a request is repeated [s].
ANSWER_TIMEOUT_S = 10.0
REPEAT_S = 1.0

MAX_REQUESTS = 128
"""Largest number of requests on one line before a proof; a board sends one per second for a minute."""

_ABOUT = struct.Struct("<HBQI")
_IN_CLEAR = (PacketType.ERROR, PacketType.BYE)


def read_key(path: str) -> bytes:
    """Read a key from a file.

    Returns
    -------
    bytes
        Content of the file without trailing white space, ``MIN_KEY_BYTES`` to ``MAX_KEY_BYTES`` long.

    Raises
    ------
    LinkError
        If the file cannot be read, has an invalid length, or others than its owner may read it.
    """
    try:
        # opening a pipe without a writer would block for ever
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(descriptor, "rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            regular = stat.S_ISREG(mode)
            data = file.read(MAX_KEY_BYTES + 1).rstrip() if regular else b""
    except OSError as error:
        raise LinkError(
            f"key file {path} cannot be read ({error.strerror}): name the one both sides have"
        ) from error
    if not regular:
        raise LinkError(f"key file {path} is a pipe or a device: copy the key to an ordinary file")
    if not MIN_KEY_BYTES <= len(data) <= MAX_KEY_BYTES:
        raise LinkError(
            f"key file {path} has {len(data)} bytes, allowed: {MIN_KEY_BYTES} to {MAX_KEY_BYTES};"
            " flyaround hil key FILE writes one"
        )
    if os.name == "posix" and mode & 0o077:
        raise LinkError(f"key file {path} may be read by others: chmod 600 {path}")
    return data


def _proof(key: bytes, label: str, nonces: bytes) -> bytes:
    return hmac.new(key, label.encode() + nonces, hashlib.sha256).digest()


class Seal:
    """Counters and MACs of both directions of one session.

    Parameters
    ----------
    key : bytes
        Pre-shared key.
    nonces : bytes
        Nonces of the board, then of the host.
    is_host : bool
        True at the host.
    """

    def __init__(self, key: bytes, nonces: bytes, *, is_host: bool) -> None:
        board_proof, host_proof = (
            _proof(key, "flyaround to board", nonces),
            _proof(key, "flyaround to host", nonces),
        )
        self._out, self._in = (board_proof, host_proof) if is_host else (host_proof, board_proof)
        self._sent = 0
        self._newest = 0
        self._seen = 0  # bit k is set if the counter k below the newest was received

    def seal(self, packet: Packet) -> Packet:
        """Return the packet with counter and MAC after its payload."""
        self._sent += 1
        body = packet.payload + COUNTER.pack(self._sent)
        return replace(packet, payload=body + self._mac(self._out, packet, body))

    def open(self, packet: Packet) -> Packet:
        """Return the packet before sealing.

        Raises
        ------
        UnsealedPacket
            If the MAC is missing or wrong.
        RepeatedPacket
            If the counter was received before.
        """
        if len(packet.payload) < TRAILER_BYTES:
            raise UnsealedPacket(f"a {packet.type.name} packet has no MAC: it is not of this session")
        body, mac = packet.payload[:-MAC_BYTES], packet.payload[-MAC_BYTES:]
        if not hmac.compare_digest(mac, self._mac(self._in, packet, body)):
            raise UnsealedPacket(f"a {packet.type.name} packet has a wrong MAC: it is not of this session")
        (counter,) = COUNTER.unpack(body[-COUNTER.size :])
        self._take(counter, packet.type.name)
        return replace(packet, payload=body[: -COUNTER.size])

    def _take(self, counter: int, name: str) -> None:
        lead = counter - self._newest
        if lead > 0:
            self._seen = ((self._seen << min(lead, WINDOW)) | 1) & ((1 << WINDOW) - 1)
            self._newest = counter
            return
        if -lead >= WINDOW or self._seen >> -lead & 1:
            raise RepeatedPacket(f"a {name} packet was received twice, or much too late")
        self._seen |= 1 << -lead

    @staticmethod
    def _mac(key: bytes, packet: Packet, body: bytes) -> bytes:
        header = _ABOUT.pack(packet.version, packet.type, packet.session_id, packet.sequence)
        return hmac.new(key, header + body, hashlib.sha256).digest()[:MAC_BYTES]


class HostHandshake:
    """Host side of the handshake: answers requests, and holds a `Seal` once a board has proved that it has the key."""

    def __init__(self, key: bytes, clock: Callable[[], float] = time.monotonic) -> None:
        self._key, self._clock = key, clock
        self._nonces: Optional[bytes] = None
        self._n_requests = 0
        self._last_answer_s = -REPEAT_S
        self.seal: Optional[Seal] = None

    def take(self, packet: Packet) -> Optional[Packet]:
        """Process a packet of the handshake, and return the answer to it.

        A repeated request gets the same answer, so that the board may use any of the answers of a slow host. A
        restarted board uses another nonce; the previous seal remains valid until the new proof.

        Returns
        -------
        Packet or None
            Challenge to a request; None after a proof, whose seal is held from then on, and for any other packet.

        Raises
        ------
        LinkClosed
            If the first proof on this line is wrong, or there are too many requests without a proof.
        UnsealedPacket
            If a proof is wrong, or there are too many requests, after a board has been authenticated: a stranger may
            have sent them, so the session continues.
        """
        if packet.type is PacketType.AUTH_REQUEST and len(packet.payload) == NONCE_BYTES:
            return self._challenge(packet.payload)
        if packet.type is PacketType.AUTH_PROOF and self._nonces is not None:
            if not hmac.compare_digest(packet.payload, _proof(self._key, "flyaround board", self._nonces)):
                if self.seal is not None:
                    raise UnsealedPacket("a proof with another key, after a board was authenticated")
                self._nonces = None
                raise LinkClosed("it has another key")
            if self.seal is None or self._nonces != self._of_seal:
                self._n_requests = 0
                self.seal, self._of_seal = Seal(self._key, self._nonces, is_host=True), self._nonces
        return None

    def _challenge(self, board_nonce: bytes) -> Packet:
        self._n_requests += 1
        now_s = self._clock()
        if self.seal is not None and now_s - self._last_answer_s < REPEAT_S / 2:
            raise UnsealedPacket("a request for a proof comes too soon after another one")
        if self.seal is None and self._n_requests > MAX_REQUESTS:
            raise LinkClosed("it sends requests without a proof")
        self._last_answer_s = now_s
        if self._nonces is None or self._nonces[:NONCE_BYTES] != board_nonce:
            self._nonces = board_nonce + os.urandom(NONCE_BYTES)
        answer = self._nonces[NONCE_BYTES:] + _proof(self._key, "flyaround host", self._nonces)
        return Packet(PacketType.AUTH_CHALLENGE, answer)

    _of_seal: bytes = b""


class HostTransport(WrappedTransport):
    """Line on which a board must prove that it has the key before other messages are accepted.

    Faults of a line act below it, on sealed packets.
    """

    def __init__(self, line: Transport, key: bytes) -> None:
        super().__init__(line)
        self._handshake = HostHandshake(key)

    def send_packet(self, packet: Packet) -> None:
        """Send a sealed packet. Before the proof only errors and goodbyes are sent, unsealed.

        Raises
        ------
        LinkClosed
            If the other side has not proved that it has the key.
        """
        seal = self._handshake.seal
        if seal is not None:
            packet = seal.seal(packet)
        elif packet.type not in _IN_CLEAR:
            raise LinkClosed(f"{self.name} has not proved that it has the key")
        self._line.send_packet(packet)

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet of this session.

        Returns
        -------
        Packet or None
            Opened packet of an authenticated board; None after ``timeout_s``. Packets of the handshake are answered
            here.

        Raises
        ------
        LinkClosed
            If the other side does not prove that it has the key.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            packet = self._line.recv_packet(max(0.0, deadline - time.monotonic()))
            if packet is None:
                return None
            if packet.type in (PacketType.AUTH_REQUEST, PacketType.AUTH_PROOF):
                answer = self._handshake.take(packet)
                if answer is not None:
                    self._line.send_packet(answer)
            elif self._handshake.seal is not None:
                return self._handshake.seal.open(packet)
            else:
                why = "the host asks for a key: start the board with --key FILE"
                with contextlib.suppress(LinkClosed):  # the board may have disconnected
                    self._line.send_packet(
                        Packet(PacketType.ERROR, ErrorMessage(ErrorCode.OTHER, why).encode())
                    )
                raise LinkClosed("it did not prove that it has the host's key: start it with --key FILE")


class BoardTransport(WrappedTransport):
    """Line to a host that has proved that it has the key."""

    def __init__(self, line: Transport, seal: Seal, proof: Packet) -> None:
        super().__init__(line)
        self._seal, self._proof = seal, proof

    def send_packet(self, packet: Packet) -> None:
        """Send a sealed packet. The proof is repeated before HELLO, because a lossy line may have lost it."""
        if packet.type is PacketType.HELLO:
            self._line.send_packet(self._proof)
        self._line.send_packet(self._seal.seal(packet))

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """Return the next packet of this session; None after ``timeout_s``."""
        deadline = time.monotonic() + timeout_s
        while True:
            packet = self._line.recv_packet(max(0.0, deadline - time.monotonic()))
            if packet is None:
                return None
            # a slow host answers each of the repeated requests
            if packet.type is not PacketType.AUTH_CHALLENGE:
                return self._seal.open(packet)


def prove_to_host(line: Transport, key: bytes, timeout_s: float = ANSWER_TIMEOUT_S) -> BoardTransport:
    """Run the handshake of a board or truth logger.

    Returns
    -------
    BoardTransport
        Sealed line to a host with the same key, over ``line``.

    Raises
    ------
    LinkError
        If the host has another key or none, or does not answer within ``timeout_s``.
    """
    nonce = os.urandom(NONCE_BYTES)
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        line.send_packet(Packet(PacketType.AUTH_REQUEST, nonce))
        repeat = min(deadline, time.monotonic() + REPEAT_S)
        while time.monotonic() < repeat:
            try:
                packet = line.recv_packet(max(0.0, repeat - time.monotonic()))
            except PacketError:
                continue
            if packet is None:
                break
            if packet.type is PacketType.ERROR:
                message = decode_message(packet)
                if isinstance(message, ErrorMessage):
                    raise LinkError(f"the host at {line.name} refuses: {message.text}")
            answer = _checked(line.name, key, nonce, packet)
            if answer is not None:
                seal, proof = answer
                line.send_packet(proof)
                return BoardTransport(line, seal, proof)
    raise LinkError(
        f"the host at {line.name} does not authenticate (waited {timeout_s:g} s): was it started with --key?"
    )


def _checked(name: str, key: bytes, nonce: bytes, packet: Packet) -> Optional[Tuple[Seal, Packet]]:
    if packet.type is not PacketType.AUTH_CHALLENGE or len(packet.payload) != NONCE_BYTES + PROOF_BYTES:
        return None
    nonces = nonce + packet.payload[:NONCE_BYTES]
    if not hmac.compare_digest(packet.payload[NONCE_BYTES:], _proof(key, "flyaround host", nonces)):
        raise LinkError(f"the host at {name} has another key: give both sides the same file")
    proof = Packet(PacketType.AUTH_PROOF, _proof(key, "flyaround board", nonces))
    return Seal(key, nonces, is_host=False), proof
