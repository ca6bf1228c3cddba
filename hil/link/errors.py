"""What can go wrong on the link, each as one sentence saying what, where and what to do."""


class LinkError(Exception):
    """The link failed or the other side refused; the message is one sentence for the user."""


class LinkClosed(LinkError):  # noqa: N818 - it is an event as much as an error
    """The other side closed the line or it broke."""


class PacketError(LinkError):
    """Bytes arrived that are not a valid packet; the link stays usable and the bytes are dropped."""


class VersionMismatch(PacketError):  # noqa: N818 - the trade's word
    """An intact packet of another protocol version."""
