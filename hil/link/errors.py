"""What can go wrong on the link, each as one sentence saying what, where and what to do."""

from __future__ import annotations

from typing import Optional


class LinkError(Exception):
    """The link failed or the other side refused; the message is one sentence for the user."""


class LinkClosed(LinkError):  # noqa: N818 - it is an event as much as an error
    """The other side closed the line or it broke."""


class FormatRefused(LinkError):  # noqa: N818 - it is a decision as much as an error
    """The board takes no pixel format that the host can send."""


class PacketError(LinkError):
    """Bytes arrived that are not a valid packet; the link stays usable and the bytes are dropped."""


class VersionMismatch(PacketError):  # noqa: N818 - the trade's word
    """An intact packet of another protocol version."""


class ProtocolMistake(PacketError):  # noqa: N818 - the sender's, not the line's
    """An intact packet that says what the protocol does not allow: the sender is at fault, not the line.

    Parameters
    ----------
    frame_id : the frame that the packet is about; None where it is about none.
    """

    def __init__(self, sentence: str, frame_id: Optional[int] = None) -> None:
        super().__init__(sentence)
        self.frame_id = frame_id


class RepeatedPacket(PacketError):  # noqa: N818 - it is not wrong, only late
    """A sealed packet that came already, or long after its time: passed over, as if it had not come."""


class UnsealedPacket(PacketError):  # noqa: N818 - it is a stranger's as often as an error
    """An intact packet without the seal of a session whose board has proved itself: dropped and counted."""
