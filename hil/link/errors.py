"""Errors of the link; each message is one sentence with the problem, the place and the remedy."""

from __future__ import annotations

from typing import Optional


class LinkError(Exception):
    """Failure of the link or refusal by the other side; the message is one sentence for the user."""


class LinkClosed(LinkError):  # noqa: N818 - it is an event as much as an error
    """End of the line: closed by the other side or broken."""


class FormatRefused(LinkError):  # noqa: N818 - it is a decision as much as an error
    """Refusal of a board that takes no pixel format of the host."""


class PacketError(LinkError):
    """Invalid bytes on the line; they are dropped and the link stays usable."""


class VersionMismatch(PacketError):  # noqa: N818 - the trade's word
    """Intact packet of another protocol version."""


class ProtocolMistake(PacketError):  # noqa: N818 - the sender's, not the line's
    """Intact packet that violates the protocol: the sender is at fault, not the line.

    Parameters
    ----------
    frame_id : int, optional
        The frame that the packet is about; None where it is about none.
    """

    def __init__(self, sentence: str, frame_id: Optional[int] = None) -> None:
        super().__init__(sentence)
        self.frame_id = frame_id


class RepeatedPacket(PacketError):  # noqa: N818 - it is not wrong, only late
    """Sealed packet received twice or much too late; it is ignored."""


class UnsealedPacket(PacketError):  # noqa: N818 - it is a stranger's as often as an error
    """Intact packet without the seal of an authenticated session; it is dropped and counted."""
