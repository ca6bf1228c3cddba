"""TCP transport: length-prefixed packets, no delay, deadlines in both directions."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import select
import socket
import time
from typing import Optional

from flyaround.hil.link.errors import LinkClosed, LinkError
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.transports.base import StreamTransport

# Time-out for a peer that accepts no byte [s]
SEND_STALL_S = 1.5
# Time-out for a peer whose system acknowledges nothing, as with a cut cable (TCP_USER_TIMEOUT) [ms]
UNACKNOWLEDGED_MS = 1500
MAX_TIMEOUT_S = 86_400.0  # upper bound of a user's time-out [s]
# Time-out for one packet [s]; a slower peer would only block the sender
SEND_PACKET_S = 60.0
# Keep-alive probes: an idle peer whose machine vanished is detected after about half a minute
KEEPALIVE_S = (("TCP_KEEPIDLE", 15), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3))
# Pause when no connection can be accepted for lack of file descriptors or memory [s], to avoid a busy loop
EXHAUSTED_PAUSE_S = 0.01
# Size of one read [bytes]: a frame is parsed while the rest of it arrives
READ_BYTES = 1 << 18


EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


def _wait(sock: socket.socket, event: int, timeout_s: float) -> bool:
    poller = select.poll()
    poller.register(sock, event)
    return bool(poller.poll(timeout_s * 1e3))


def keep_alive(sock: socket.socket) -> None:
    """Enable keep-alive probes; raise OSError if the connection is gone already."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE_S:
        if hasattr(socket, name):  # TCP_KEEPIDLE has another name on macOS
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


class SocketTransport(StreamTransport):
    """One stream socket.

    Parameters
    ----------
    sock : socket
        Connected socket.
    name : str
        Name of the line in messages.
    send_stall_s : float
        Longest time in which the peer may accept no byte [s].
    send_packet_s : float
        Longest time to send one packet [s].
    """

    def __init__(
        self,
        sock: socket.socket,
        name: str,
        send_stall_s: float = MAX_TIMEOUT_S,
        send_packet_s: float = MAX_TIMEOUT_S,
    ) -> None:
        super().__init__(name, LengthFraming())
        sock.setblocking(False)
        self._sock = sock
        self._send_stall_s, self._send_packet_s = send_stall_s, send_packet_s

    def fileno(self) -> int:
        """Return the file descriptor of the socket.

        Returns
        -------
        int
            Descriptor that becomes readable when bytes arrive; -1 after the line was closed.
        """
        return self._sock.fileno()

    def close(self) -> None:
        """Shut down the connection. Closing twice is allowed."""
        if not self._closed:
            self._closed = True
            with contextlib.suppress(OSError):  # the peer may have closed it already
                self._sock.shutdown(socket.SHUT_RDWR)
            self._sock.close()

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        deadline = time.monotonic() + self._send_packet_s
        try:
            while view:
                try:
                    view = view[self._sock.send(view) :]
                except BlockingIOError:
                    if not _wait(self._sock, select.POLLOUT, self._send_stall_s):
                        raise LinkClosed(
                            f"{self.name} accepted no byte for {self._send_stall_s:g} s:"
                            " it hangs or the network is cut"
                        ) from None
                    if time.monotonic() > deadline:
                        raise LinkClosed(
                            f"{self.name} accepted {len(data)} bytes in more than {self._send_packet_s:g} s:"
                            " it hangs or the network is too slow"
                        ) from None
        except OSError as error:
            raise LinkClosed(f"{self.name} went away during sending ({error.strerror})") from error
        except ValueError as error:
            raise LinkClosed(f"{self.name} is closed") from error

    def _read(self, timeout_s: float) -> bytes:
        try:
            try:
                data = self._sock.recv(READ_BYTES)
            except BlockingIOError:
                if timeout_s <= 0 or not _wait(self._sock, select.POLLIN, timeout_s):
                    return b""
                data = self._sock.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkClosed(f"{self.name} went away ({error.strerror})") from error
        except ValueError as error:  # closed by another thread in the meantime: the descriptor is -1
            raise LinkClosed(f"{self.name} is closed") from error
        if not data:
            raise LinkClosed(f"{self.name} closed the connection")
        return data


class TcpTransport(SocketTransport):
    """One TCP connection."""

    def __init__(
        self,
        sock: socket.socket,
        name: str,
        send_stall_s: float = SEND_STALL_S,
        send_packet_s: float = SEND_PACKET_S,
    ) -> None:
        super().__init__(sock, name, send_stall_s, send_packet_s)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        keep_alive(sock)
        self.set_silence_limit(0.0)

    def set_silence_limit(self, silence_s: float) -> None:
        """Set the silence after which a peer is considered lost, if longer than the default."""
        silence_s = min(silence_s, MAX_TIMEOUT_S)
        self._send_stall_s = max(self._send_stall_s, silence_s)
        self._send_packet_s = max(self._send_packet_s, silence_s)
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # not available on macOS
            unacknowledged_ms = max(UNACKNOWLEDGED_MS, int(silence_s * 1e3))
            self._sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unacknowledged_ms)


def connect_tcp(host: str, port: int, timeout_s: float) -> TcpTransport:
    """Connect to a host, retrying while nobody listens.

    Returns
    -------
    TcpTransport
        Line to the host, named ``tcp://HOST:PORT``.

    Raises
    ------
    LinkError
        If nobody listens within ``timeout_s``, or that is negative or not finite.
    """
    if not 0 <= timeout_s < math.inf:
        raise LinkError(f"the time to connect is {timeout_s} s: give 0 or more")
    deadline = time.monotonic() + timeout_s
    while True:
        left_s = deadline - time.monotonic()
        try:
            sock = socket.create_connection((host, port), timeout=max(0.1, left_s))
        except socket.gaierror as error:
            raise LinkError(
                f"host name {host!r} is unknown: check the link URL tcp://{host}:{port}"
            ) from error
        except OSError as error:
            if left_s <= 0:
                reason = error.strerror or "no answer"
                raise LinkError(
                    f"nobody listens on tcp://{host}:{port} ({reason}, tried for {timeout_s:g} s):"
                    " start the other side first, or check host and port"
                ) from error
            time.sleep(min(0.1, max(0.0, left_s)))
        else:
            return TcpTransport(sock, f"tcp://{host}:{port}")


class TcpListener:
    """Listening TCP socket.

    Raises
    ------
    LinkError
        If the address or port is not available.
    """

    def __init__(self, host: str, port: int) -> None:
        sock = None
        try:
            family, kind, proto, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            sock = socket.socket(family, kind, proto)
            # reuse a port in TIME_WAIT after the last run, but not one with a listener
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(address)
            sock.listen(64)  # with a shorter queue, a board waits seconds behind a burst of others
            self._spare: Optional[int] = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            if sock is not None:
                sock.close()
            if error.errno == errno.EADDRINUSE:
                raise LinkError(
                    f"port {port} on {host} is in use by another program:"
                    " stop it, or choose another port in the link URL"
                ) from error
            raise LinkError(
                f"cannot listen on tcp://{host}:{port} ({error.strerror}): choose another address or port"
            ) from error
        sock.setblocking(False)
        self._sock = sock
        bound = sock.getsockname()[1]
        self.url = f"tcp://[{host}]:{bound}" if ":" in host else f"tcp://{host}:{bound}"

    def accept_socket(self, timeout_s: float) -> Optional[socket.socket]:
        """Return the socket of a new peer.

        Returns
        -------
        socket or None
            Connected socket, which the caller closes; None after ``timeout_s``, or before if the peer has left or no
            descriptor is free.
        """
        try:
            return self._sock.accept()[0] if _wait(self._sock, select.POLLIN, timeout_s) else None
        except (BlockingIOError, ConnectionError):
            return None  # the peer disconnected before it was accepted
        except OSError as error:
            if error.errno not in EXHAUSTED:
                return None  # a network error of that one connection, see accept(2)
            self._refuse_connection()
            return None

    def _refuse_connection(self) -> None:
        """Accept and close one pending connection using the reserved file descriptor.

        Without this the listening socket would stay readable, and the caller's loop would spin.
        """
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
        with contextlib.suppress(OSError):
            self._sock.accept()[0].close()
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
        time.sleep(EXHAUSTED_PAUSE_S)

    def accept(self, timeout_s: float) -> Optional[TcpTransport]:
        """Return a connection to a new peer.

        Returns
        -------
        TcpTransport or None
            Line to the peer, named by its address; None after ``timeout_s`` or if no connection could be accepted.
        """
        sock = self.accept_socket(timeout_s)
        if sock is None:
            return None
        try:
            peer = sock.getpeername()
            return TcpTransport(sock, f"tcp://{peer[0]}:{peer[1]}")
        except OSError:  # the peer disconnected already
            sock.close()
            return None

    def fileno(self) -> int:
        """Return the file descriptor of the socket.

        Returns
        -------
        int
            Descriptor that becomes readable when a peer connects; -1 after `close`.
        """
        return self._sock.fileno()

    def close(self) -> None:
        """Stop listening."""
        self._sock.close()
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
