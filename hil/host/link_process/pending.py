"""Connections that have not yet sent HELLO; their number and time are limited."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkClosed, PacketError, ProtocolMistake, VersionMismatch
from flyaround.hil.link.packets.messages import ErrorCode, Hello
from flyaround.hil.link.security import HostTransport
from flyaround.hil.link.session import HOST_BEFORE_HELLO, Link, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from flyaround.hil.host.link_process.board_session import BoardSession
    from flyaround.hil.link.transports.base import Transport

# Time-out for a connection's HELLO [ns].
HELLO_TIMEOUT_NS = 10_000_000_000
# Largest number of pending connections; beyond it the oldest is closed, because a board sends HELLO immediately
MAX_PENDING = 8
# Number of other packets than HELLO after which a connection is closed
MAX_OTHER_PACKETS = 64


class PendingLinks:
    """Connections that have not yet sent HELLO, so that a silent connection does not block other boards.

    Parameters
    ----------
    on_close : callable
        Called with the reason for each connection that was closed.
    busy : str, optional
        Reason for refusing a board while another one is connected.
    key : bytes, optional
        Pre-shared key that boards must prove to have; None disables authentication.
    """

    def __init__(self, on_close: Callable[[str], None], busy: str = "", key: bytes | None = None) -> None:
        self._on_close, self._busy, self._key = on_close, busy, key
        self._links: list[tuple[Link, int]] = []  # each with its time-out for HELLO

    def __len__(self) -> int:
        return len(self._links)

    @property
    def transports(self) -> list[Any]:
        """File descriptors to wait on."""
        return [link.transport for link, _ in self._links]

    @property
    def first_deadline_ns(self) -> int | None:
        """Earliest time-out; None without connections."""
        return min((deadline for _, deadline in self._links), default=None)

    def add(self, transport: Transport) -> None:
        """Add a connection; if there are too many, the oldest is closed."""
        if len(self._links) >= MAX_PENDING:
            self._refuse(
                self._links[0][0],
                ErrorCode.BUSY,
                "it sent no HELLO while others connected: send HELLO at once",
            )
        self._links.append((Link(transport, accepts=HOST_BEFORE_HELLO), now_ns() + HELLO_TIMEOUT_NS))

    def admit(self, board: BoardSession, ready: Collection[Any], arrived: Transport | None) -> None:
        """Begin the session of the first board that says HELLO, and refuse others.

        Parameters
        ----------
        board : BoardSession
            Session, with or without a board.
        ready : collection
            Connections with input.
        arrived : Transport or None
            New connection.
        """
        if arrived is not None:
            if self._key is not None:
                arrived = HostTransport(arrived, self._key)
            if board.link is not None:
                refuse(Link(arrived), ErrorCode.BUSY, self._busy)
                return
            self.add(arrived)
            ready = [*ready, arrived]
        greeting = None if board.link is not None else self.receive_hello(ready)
        if greeting is not None and board.begin(*greeting):
            self.refuse_all(self._busy)
            board.listen()

    def receive_hello(self, ready: Collection[Any]) -> tuple[Link, Hello] | None:
        """Return the first of the ``ready`` connections that sends HELLO, with the message. It is no longer pending."""
        for link, _ in list(self._links):
            if link.transport in ready and (hello := self._hello(link)) is not None:
                self._remove(link)
                return link, hello
        return None

    def expire(self, at_ns: int) -> None:
        """Close connections that timed out."""
        for link, deadline in list(self._links):
            if at_ns >= deadline:
                self._drop(link, "it sent no packet of the link protocol")

    def refuse_all(self, sentence: str) -> None:
        """Close all connections, with a message."""
        for link, _ in self._links:
            refuse(link, ErrorCode.BUSY, sentence)
        self._links = []

    def _hello(self, link: Link) -> Hello | None:
        for _ in range(MAX_OTHER_PACKETS):
            try:
                message = link.recv(0.0)
            except VersionMismatch as error:
                self._refuse(link, ErrorCode.VERSION, str(error))
                return None
            except ProtocolMistake as mistake:
                self._refuse(link, ErrorCode.FORMAT, str(mistake))
                return None
            except PacketError:
                continue
            except LinkClosed as error:
                self._drop(link, str(error))
                return None
            if isinstance(message, Hello):
                return message
            if message is None and not link.yielded:
                return None
        self._drop(link, "it sent no packet of the link protocol")
        return None

    def _refuse(self, link: Link, code: ErrorCode, sentence: str) -> None:
        self._remove(link)
        refuse(link, code, sentence)
        self._on_close(sentence)

    def _drop(self, link: Link, reason: str) -> None:
        self._remove(link)
        link.transport.close()
        self._on_close(reason)

    def _remove(self, link: Link) -> None:
        self._links = [pair for pair in self._links if pair[0] is not link]
