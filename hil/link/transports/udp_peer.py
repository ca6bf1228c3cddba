"""One other side on UDP: its packets as fragments, what it has and misses, and whether it is there. No sockets."""

from __future__ import annotations

import socket
import threading
import time
from typing import Any, Optional, Protocol

from flyaround.hil.link.errors import LinkClosed, PacketError
from flyaround.hil.link.framing.datagrams import (
    ACK,
    DATA,
    HELD_BYTES,
    PING,
    RANGE,
    Incoming,
    Kind,
    Outgoing,
    datagram,
)
from flyaround.hil.link.packets.packet import MAX_PACKET_BYTES, Packet, decode_packet, encode_packet

# a peer that says nothing for this long is gone; it is asked four times a second
SILENCE_S = 1.5
PING_NS = 250_000_000
# what one that leaves may still have to say
LINGER_NS = 1_000_000_000
# the longest that a session may ask to wait; also for a peer that takes nothing
LONGEST_S = 86_400.0
# an unread gap is told again, and what was sent asked after, this often at most
REPEAT_NS = 5_000_000
LEAST_ASK_NS, MOST_ASK_NS = 20_000_000, 250_000_000
# datagrams overtake each other by this much on a network of one room
REORDER_NS = 3_000_000
PENDING_BYTES = 2 * MAX_PACKET_BYTES

Address = Any


class PeersEndpoint(Protocol):
    """Whose socket and thread serve a peer."""

    changed: threading.Condition
    window_bytes: int

    def send(self, data: bytes, peer: UdpTransport) -> bool:
        """Put a datagram on the network; False where the system takes none now."""

    def wake(self) -> None:
        """Let the thread look after its peers at once."""

    def has_left(self) -> None:
        """A peer was closed on this side."""


class Bell:
    """A descriptor that is readable while something is there to be fetched."""

    def __init__(self) -> None:
        self._ours, self._theirs = socket.socketpair()
        self._rings = False
        for end in (self._ours, self._theirs):
            end.setblocking(False)

    def set(self, ringing: bool) -> None:  # noqa: FBT001 - it is what it is set to
        """Ring, or stop it."""
        if ringing and not self._rings:
            self._theirs.send(b"!")
        elif self._rings and not ringing:
            self._ours.recv(16)
        self._rings = ringing

    def fileno(self) -> int:
        """What to wait on."""
        return self._ours.fileno()

    def close(self) -> None:
        """Give both ends back."""
        self._ours.close()
        self._theirs.close()


class UdpTransport:
    """One other side, whose datagrams an endpoint's thread takes and answers."""

    chunk_bytes = 1 << 16

    def __init__(
        self, endpoint: PeersEndpoint, name: str, address: Address, token: int, datagram_bytes: int
    ) -> None:
        self.name = name
        self.address, self.token = address, token
        self._endpoint = endpoint
        self._changed = endpoint.changed
        self._bell = Bell()
        self.outgoing, self.incoming = Outgoing(token, datagram_bytes), Incoming()
        now = time.monotonic_ns()
        self.heard_ns = self._progress_ns = self._pinged_ns = now
        self._acked_ns = 0
        self._ask_ns = LEAST_ASK_NS
        self._trip_ns = REORDER_NS
        self._echo_ns = 0
        self._silence_s = SILENCE_S
        self.owes_ack = False
        self.closed_by_us = False
        self._linger_until_ns = 0
        self.ended = ""  # why the other side is gone

    # --- the link's side ----------------------------------------------------------------------

    def be_patient(self, silence_s: float) -> None:
        """Wait so long for a side that says nothing or takes no byte, where that is longer."""
        self._silence_s = max(self._silence_s, min(silence_s, LONGEST_S))

    def send_packet(self, packet: Packet) -> None:
        """Send, or raise LinkClosed."""
        self._send(encode_packet(packet))

    def send_damaged(self, packet: Packet, at: int, flip: int) -> None:
        """Send with some bits of one byte of the line turned over: for runs with faults on purpose."""
        data = bytearray(encode_packet(packet))
        data[at % len(data)] ^= flip
        self._send(bytes(data))

    def _send(self, data: bytes) -> None:
        with self._changed:
            until = time.monotonic() + self._silence_s
            while self.outgoing.pending_bytes > PENDING_BYTES and not self.ended and not self.closed_by_us:
                if not self._changed.wait(max(0.0, until - time.monotonic())):
                    raise LinkClosed(
                        f"{self.name} took no byte for {self._silence_s:g} s: it hangs or the network is cut"
                    )
            if self.closed_by_us:
                raise LinkClosed(f"{self.name} is closed")
            if self.ended:
                raise LinkClosed(f"{self.name} {self.ended}")
            idle, now = self.outgoing.is_empty, time.monotonic_ns()
            if idle:
                self._progress_ns = now
            self.outgoing.push(data)
            self.flush(now)
        if idle:  # the thread sleeps longer than a loss should last
            self._endpoint.wake()

    def recv_packet(self, timeout_s: float) -> Optional[Packet]:
        """The next packet, None after ``timeout_s``; PacketError for damage, LinkClosed at the end."""
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while True:
                if self.closed_by_us:
                    raise LinkClosed(f"{self.name} is closed")
                item = self.incoming.pop()
                self._ring()
                if item is not None:
                    break
                if self.ended:
                    raise LinkClosed(f"{self.name} {self.ended}")
                left = deadline - time.monotonic()
                if left <= 0:
                    return None
                self._changed.wait(left)
        if isinstance(item, PacketError):
            raise item
        return decode_packet(item)

    def fileno(self) -> int:
        """Readable while a packet, or the end, waits."""
        return self._bell.fileno()

    def close(self) -> None:
        """Give the line back; what was said still goes out, for a second at most."""
        with self._changed:
            if self.closed_by_us:
                return
            self.closed_by_us = True
            self._linger_until_ns = time.monotonic_ns() + LINGER_NS
            self._changed.notify_all()
        self._endpoint.wake()
        self._endpoint.has_left()
        self._bell.close()

    def _ring(self) -> None:
        if not self.closed_by_us:
            self._bell.set(bool(self.incoming.ready) or bool(self.ended))

    # --- the thread's side --------------------------------------------------------------------

    def flush(self, now: int) -> None:
        """Send what the window has room for."""
        while True:
            data = self.outgoing.next_to_send()
            if data is None or not self._endpoint.send(data, self):
                return
            self.outgoing.has_sent(now)

    def end(self, why: str) -> None:
        """The other side is gone."""
        if not self.ended:
            self.ended = why
            self._ring()
            self._changed.notify_all()

    def take(self, kind: Kind, body: memoryview, now: int) -> None:
        """One datagram of this session."""
        self.heard_ns = now
        if kind is Kind.DATA and len(body) >= DATA.size:
            number, index, count = DATA.unpack_from(body)
            before = len(self.incoming.ready)
            self.incoming.add(number, index, count, bytes(body[DATA.size :]), now)
            self.owes_ack = True
            if len(self.incoming.ready) != before:
                self._ring()
                self._changed.notify_all()
        elif kind is Kind.ACK and len(body) >= ACK.size:
            self._take_ack(body, now)
        elif kind is Kind.PING and len(body) == PING.size:
            end, self._echo_ns = PING.unpack_from(body)
            self.incoming.sent_to(end, now)
            self.owes_ack = True
        elif kind is Kind.CLOSE:
            self.end("closed the connection")

    def _take_ack(self, body: memoryview, now: int) -> None:
        wanted, held, window, echo_ns, count = ACK.unpack_from(body)
        if len(body) != ACK.size + count * RANGE.size:
            return
        if 0 < echo_ns <= now:
            self._trip_ns = (7 * self._trip_ns + min(now - echo_ns, 10**9)) // 8
        self.outgoing.window_bytes = window
        missing = list(RANGE.iter_unpack(body[ACK.size :]))
        patience_ns = max(REORDER_NS, 2 * self._trip_ns)
        progress, again = self.outgoing.acknowledged(wanted, held, missing, now, patience_ns)
        if progress:
            self._progress_ns, self._ask_ns = now, LEAST_ASK_NS
            self._changed.notify_all()
        for told in again:
            self._endpoint.send(told, self)
        self.flush(now)

    def acknowledge(self, now: int) -> None:
        """Tell what came and what did not."""
        self.owes_ack, self._acked_ns = False, now
        missing = self.incoming.missing()
        unread = HELD_BYTES - self.incoming.ready_bytes
        window = max(0, min(self._endpoint.window_bytes, unread))
        told = ACK.pack(self.incoming.wanted, self.incoming.held, window, self._echo_ns, len(missing))
        self._echo_ns = 0
        self._endpoint.send(
            datagram(Kind.ACK, self.token, told, *(RANGE.pack(*gap) for gap in missing)), self
        )

    def tick(self, now: int) -> int:
        """What is due; when to come again at the latest."""
        again = now + PING_NS
        if self.owes_ack or (self.incoming.has_gap and now - self._acked_ns >= REPEAT_NS):
            self.acknowledge(now)
        if self.incoming.has_gap:
            again = min(again, now + REPEAT_NS)
            if self.incoming.give_up(now):
                self._ring()
                self._changed.notify_all()
        ask_ns = PING_NS
        if self.outgoing.waits:
            self.flush(now)
            ask_ns = max(self._ask_ns, 4 * self._trip_ns) if self._ask_ns < MOST_ASK_NS else MOST_ASK_NS
            last = max(self._progress_ns, self._pinged_ns)
        else:
            last = max(self._pinged_ns, self._acked_ns)
        if now - last >= ask_ns:
            self._pinged_ns = now
            self._ask_ns = min(2 * self._ask_ns, MOST_ASK_NS)
            self._endpoint.send(
                datagram(Kind.PING, self.token, PING.pack(self.outgoing.next_number, now)), self
            )
            last = now
        if now - self.heard_ns > self._silence_s * 1e9:
            self.end(f"said nothing for {self._silence_s:g} s: it hangs or the network is cut")
        return min(again, last + ask_ns)

    def may_go(self, now: int) -> bool:
        """Whether this side has left and all was said."""
        return self.closed_by_us and (
            self.outgoing.is_empty or bool(self.ended) or now >= self._linger_until_ns
        )
