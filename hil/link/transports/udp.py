"""UDP: packets in datagrams that are acknowledged, asked for again and put in order, for a bench's own network.

The host allocates nothing for an address before it has answered from there. There is no congestion control: what is
under way is bounded by the receiver's own buffer alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import select
import socket
import struct
import threading
import time
from collections import deque
from typing import Deque, Dict, Optional, Tuple

from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.framing.datagrams import (
    DATAGRAM_BYTES,
    LEAST_DATAGRAM_BYTES,
    MOST_DATAGRAM_BYTES,
    OPEN,
    OPEN_BYTES,
    Kind,
    datagram,
    split_datagram,
)
from flyaround.hil.link.transports.udp_peer import LINGER_NS, Address, Bell, UdpTransport

# one that refuses, as the system of its machine says, has this long to come back
REFUSED_NS = 1_000_000_000
MOST_PEERS = 16
_DRAIN = 64


class _Endpoint:
    """One socket, its thread, and whoever is at the other end of it.

    Parameters
    ----------
    sock : bound, or connected to the host. datagram_bytes : largest datagram that is sent.
    listening : whether others may come.
    """

    def __init__(self, sock: socket.socket, datagram_bytes: int, *, listening: bool) -> None:
        sock.setblocking(False)
        for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
            with contextlib.suppress(OSError):
                sock.setsockopt(socket.SOL_SOCKET, option, 4 << 20)
        # what a datagram takes up in the system's buffer is up to twice its own length and more
        self.window_bytes = sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 4
        self._sock, self._datagram_bytes = sock, datagram_bytes
        self.changed = threading.Condition()
        self._peers: Dict[Tuple[Address, int], UdpTransport] = {}
        self.arrived: Deque[UdpTransport] = deque()
        self.listening = listening
        self._secret = os.urandom(32)
        self.bell, self._wake = Bell(), Bell()
        self._refused_ns = 0
        self._over = False
        self._thread = threading.Thread(target=self._run, name="udp", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def add(self, peer: UdpTransport) -> None:
        """Serve another side."""
        with self.changed:
            self._peers[self._key(peer.address), peer.token] = peer

    @staticmethod
    def _key(address: Address) -> Address:
        return None if address is None else address[:2]

    def wake(self) -> None:
        """Let the thread look after its peers at once."""
        with self.changed:
            if not self._over:
                self._wake.set(True)

    def send(self, data: bytes, peer: UdpTransport) -> bool:
        """Put a datagram on the network; False where the system takes none now."""
        return self._send_to(data, peer.address)

    def _send_to(self, data: bytes, address: Address) -> bool:
        try:
            if address is None:
                self._sock.send(data)
            else:
                self._sock.sendto(data, address)
        except BlockingIOError:
            return False
        except ConnectionRefusedError:
            self._refused_ns = self._refused_ns or time.monotonic_ns()
            return False
        except OSError:  # a network that is down for a moment loses datagrams as any other
            return True
        return True

    def has_left(self) -> None:
        """A side that is left alone waits until all was said; a listener's is waited for when that is closed."""
        if not self.listening:
            self.join_leavers()

    def join_leavers(self) -> None:
        """Wait until those that left have said all, for a second at most."""
        until = time.monotonic() + LINGER_NS * 1.2e-9
        with self.changed:
            while any(peer.closed_by_us for peer in self._peers.values()) and time.monotonic() < until:
                self.changed.wait(until - time.monotonic())

    def stop_listening(self) -> None:
        """Let nobody in any more; the thread ends with its last peer."""
        with self.changed:
            self.listening = False
            for peer in self.arrived:  # nobody will take them
                peer.closed_by_us = True
            self.arrived.clear()
        self.wake()
        self.join_leavers()
        with self.changed:
            alone = not self._peers
        if alone:
            self._thread.join(1.0)

    def _run(self) -> None:
        poller = select.poll()
        poller.register(self._sock.fileno(), select.POLLIN)
        poller.register(self._wake.fileno(), select.POLLIN)
        next_ns = 0
        try:
            while self.listening or self._peers:
                wait_ms = max(0.0, min(1000.0, (next_ns - time.monotonic_ns()) * 1e-6))
                poller.poll(wait_ms)
                with self.changed:
                    self._wake.set(False)
                    more = self._drain()
                    now = time.monotonic_ns()
                    next_ns = now if more else now + 10**9
                    for peer in list(self._peers.values()):
                        next_ns = min(next_ns, peer.tick(now))
                        if peer.may_go(now):
                            self._dismiss(peer)
        finally:
            with self.changed:
                for peer in self._peers.values():
                    peer.end("is closed")
                self._over = True
                self._sock.close()
                self._wake.close()
                self.bell.close()
                self.changed.notify_all()

    def _dismiss(self, peer: UdpTransport) -> None:
        if not peer.ended:
            for _ in range(3):
                self.send(datagram(Kind.CLOSE, peer.token), peer)
        del self._peers[self._key(peer.address), peer.token]
        self.changed.notify_all()

    def _drain(self) -> bool:
        """Take what has come; whether there may be more."""
        for _ in range(_DRAIN):
            try:
                data, address = self._sock.recvfrom(MOST_DATAGRAM_BYTES)
            except BlockingIOError:
                self._check_refused()
                return False
            except ConnectionRefusedError:
                self._refused_ns = self._refused_ns or time.monotonic_ns()
                self._check_refused()
                return False
            except OSError:
                return False
            self._refused_ns = 0
            parsed = split_datagram(data)
            if parsed is None:
                continue
            kind, token, body = parsed
            key = None if self._connected else self._key(address)
            peer = self._peers.get((key, token))
            if peer is not None and kind is not Kind.OPEN:
                peer.take(kind, body, time.monotonic_ns())
            elif self.listening and kind is Kind.OPEN and len(data) == OPEN_BYTES:
                self._greet(body, address)
            elif kind in (Kind.DATA, Kind.PING) and not self._connected:
                # of a session that this host knows nothing of: of one before it was started again
                self._send_to(datagram(Kind.CLOSE, token), address)
        return True

    @property
    def _connected(self) -> bool:
        return any(key is None for key, _ in self._peers)

    def _check_refused(self) -> None:
        if self._refused_ns and time.monotonic_ns() - self._refused_ns > REFUSED_NS:
            for peer in self._peers.values():
                peer.end("went away: nobody listens there any more")

    def _greet(self, body: memoryview, address: Address) -> None:
        """Let in who answers from where it says it is; a first try is answered and forgotten."""
        nonce, cookie = OPEN.unpack(body)
        about = repr(address[:2]).encode() + struct.pack("<Q", nonce)
        (token,) = struct.unpack("<Q", hmac.new(self._secret, about, hashlib.sha256).digest()[:8])
        if cookie != token:
            self._send_to(datagram(Kind.COOKIE, 0, OPEN.pack(nonce, token)), address)
            return
        key = (self._key(address), token)
        if key not in self._peers:
            if len(self._peers) >= MOST_PEERS:
                return
            host, port = address[:2]
            where = f"[{host}]" if ":" in host else host
            peer = UdpTransport(self, f"udp://{where}:{port}", address, token, self._datagram_bytes)
            self._peers[key] = peer
            self.arrived.append(peer)
            self.bell.set(True)
            self.changed.notify_all()
        self._send_to(datagram(Kind.ACCEPT, token, OPEN.pack(nonce, token)), address)


def _check_datagram_bytes(datagram_bytes: int) -> None:
    if not LEAST_DATAGRAM_BYTES <= datagram_bytes <= MOST_DATAGRAM_BYTES:
        raise LinkError(
            f"datagrams of {datagram_bytes} bytes cannot be sent: choose {LEAST_DATAGRAM_BYTES} to"
            f" {MOST_DATAGRAM_BYTES}, {DATAGRAM_BYTES} on most networks and 8900 where all have jumbo frames"
        )


def connect_udp(host: str, port: int, timeout_s: float, datagram_bytes: int = DATAGRAM_BYTES) -> UdpTransport:
    """Connect, trying again while nobody answers.

    Raises
    ------
    LinkError
        If nobody answers before ``timeout_s`` has passed.
    """
    _check_datagram_bytes(datagram_bytes)
    name = f"udp://[{host}]:{port}" if ":" in host else f"udp://{host}:{port}"
    try:
        family, kind, proto, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except socket.gaierror as error:
        raise LinkError(f"host name {host!r} is unknown: check the link URL {name}") from error
    sock = socket.socket(family, kind, proto)
    try:
        sock.connect(address)
        token = _ask_in(sock, timeout_s)
    except OSError as error:
        sock.close()
        raise LinkError(f"{name} cannot be reached ({error.strerror}): check the address") from error
    if token is None:
        sock.close()
        raise LinkError(
            f"nobody listens on {name} (tried for {timeout_s:g} s): start the other side first,"
            " or check host and port"
        )
    endpoint = _Endpoint(sock, datagram_bytes, listening=False)
    peer = UdpTransport(endpoint, name, None, token, datagram_bytes)
    endpoint.add(peer)
    endpoint.start()
    return peer


def _ask_in(sock: socket.socket, timeout_s: float) -> Optional[int]:
    """The token of a session that the host has opened; None where it did not answer."""
    deadline = time.monotonic() + timeout_s
    (nonce,) = struct.unpack("<Q", os.urandom(8))
    cookie, wait_s = 0, 0.05
    while True:
        left = deadline - time.monotonic()
        if left <= 0:
            return None
        with contextlib.suppress(ConnectionRefusedError):
            sock.send(datagram(Kind.OPEN, 0, OPEN.pack(nonce, cookie)))
        sock.settimeout(max(0.001, min(wait_s, left)))
        try:
            parsed = split_datagram(sock.recv(MOST_DATAGRAM_BYTES))
        except socket.timeout:
            wait_s = min(2 * wait_s, 0.5)
            continue
        except ConnectionRefusedError:
            time.sleep(min(0.1, left))
            continue
        if parsed is None or len(parsed[2]) != OPEN.size or OPEN.unpack(parsed[2])[0] != nonce:
            continue
        if parsed[0] is Kind.COOKIE:
            cookie = OPEN.unpack(parsed[2])[1]
        elif parsed[0] is Kind.ACCEPT:
            return parsed[1]


class UdpListener:
    """A bound socket."""

    def __init__(self, host: str, port: int, datagram_bytes: int = DATAGRAM_BYTES) -> None:
        _check_datagram_bytes(datagram_bytes)
        sock = None
        try:
            family, kind, proto, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            sock = socket.socket(family, kind, proto)
            sock.bind(address)
        except OSError as error:
            if sock is not None:
                sock.close()
            raise LinkError(
                f"cannot listen on udp://{host}:{port} ({error.strerror}): stop the program that does,"
                " or choose another address or port"
            ) from error
        bound = sock.getsockname()[1]
        self.url = f"udp://[{host}]:{bound}" if ":" in host else f"udp://{host}:{bound}"
        self._endpoint = _Endpoint(sock, datagram_bytes, listening=True)
        self._endpoint.start()

    def accept(self, timeout_s: float) -> Optional[UdpTransport]:
        """A line to whoever came, None after ``timeout_s``."""
        arrived, changed = self._endpoint.arrived, self._endpoint.changed
        with changed:
            changed.wait_for(lambda: arrived, timeout_s)
            peer = arrived.popleft() if arrived else None
            if self._endpoint.listening:
                self._endpoint.bell.set(bool(arrived))
        return peer

    def fileno(self) -> int:
        """Readable while somebody waits to be let in."""
        return self._endpoint.bell.fileno()

    def close(self) -> None:
        """Stop listening; sessions go on."""
        self._endpoint.stop_listening()
