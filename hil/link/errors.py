"""Errors of the link. Each message is one sentence: problem, place, remedy."""

from __future__ import annotations

from typing import Optional


class LinkError(Exception):
    """Failure of the link or refusal by the other side; the message is one sentence for the user."""


class LinkClosed(LinkError):  # noqa: N818 - an event as much as an error
    """End of the line: closed by the other side or broken."""


class FormatRefused(LinkError):  # noqa: N818 - a decision as much as an error
    """Refusal of a board that supports no pixel format of the host."""


class PacketError(LinkError):
    """Invalid bytes on the line; they are dropped and the link stays usable."""


class VersionMismatch(PacketError):  # noqa: N818 - established term
    """Intact packet of another protocol version."""


class ProtocolMistake(PacketError):  # noqa: N818 - the sender's mistake, not the line's
    """Intact packet that violates the protocol: the sender is at fault, not the line.

    Parameters
    ----------
    sentence : str
        Description of the violation.
    frame_id : int, optional
        Frame that the packet is about; None if there is none.
    """

    def __init__(self, sentence: str, frame_id: Optional[int] = None) -> None:
        super().__init__(sentence)
        self.frame_id = frame_id


class RepeatedPacket(PacketError):  # noqa: N818 - not wrong, only late
    """Sealed packet received twice or much too late; it is ignored."""


class UnsealedPacket(PacketError):  # noqa: N818 - sent by strangers as often as in error
    """Intact packet without the seal of an authenticated session; it is dropped and counted."""
