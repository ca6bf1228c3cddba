"""Messages in payloads: one frozen dataclass per packet type, with its struct layout."""

from __future__ import annotations

import struct
from typing import Any, Dict, Optional, Union, get_args

from flyaround.hil.link.errors import PacketError, ProtocolMistake
from flyaround.hil.link.packets.enums import (
    NO_FRAME,
    Encoding,
    ErrorCode,
    Mode,
    PixelFormat,
    Transfer,
    TruthPolicy,
)
from flyaround.hil.link.packets.frame_messages import (
    Credit,
    FrameChunk,
    FrameHeader,
    PoseMessage,
    TruthMessage,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.packets.session_messages import (
    Bye,
    ErrorMessage,
    Hello,
    HelloAck,
    TimeSyncReply,
    TimeSyncRequest,
)

__all__ = [
    "NO_FRAME",
    "Bye",
    "Credit",
    "Encoding",
    "ErrorCode",
    "ErrorMessage",
    "FrameChunk",
    "FrameHeader",
    "Hello",
    "HelloAck",
    "Message",
    "Mode",
    "PixelFormat",
    "PoseMessage",
    "TimeSyncReply",
    "TimeSyncRequest",
    "Transfer",
    "TruthMessage",
    "TruthPolicy",
    "decode_message",
]

Message = Union[
    Hello,
    HelloAck,
    TimeSyncRequest,
    TimeSyncReply,
    FrameHeader,
    FrameChunk,
    PoseMessage,
    Credit,
    TruthMessage,
    Bye,
    ErrorMessage,
]

_BY_TYPE: Dict[PacketType, Any] = {kind.TYPE: kind for kind in get_args(Message)}


# Types whose payloads begin with a frame id
ABOUT_A_FRAME = (PacketType.FRAME_HEADER, PacketType.FRAME_CHUNK, PacketType.POSE)
_FRAME_ID = struct.Struct("<I")


def decode_message(packet: Packet) -> Message:
    """Return the message in a packet.

    Returns
    -------
    Message
        Message of the class of the packet's type.

    Raises
    ------
    ProtocolMistake
        If the payload is not valid for its type. The CRC was correct, so the sender is at fault.
    """
    if packet.type not in _BY_TYPE:
        raise ProtocolMistake(f"a {packet.type.name} packet is unexpected: only one side uses a key")
    try:
        message: Message = _BY_TYPE[packet.type].decode(packet.payload)
    except PacketError as error:
        raise ProtocolMistake(str(error), frame_id_of(packet)) from error
    return message


def frame_id_of(packet: Packet) -> Optional[int]:
    """Return the number of the frame that a packet is about.

    Returns
    -------
    int or None
        Frame id; None if the packet is about no frame, or its payload is too short.
    """
    if packet.type not in ABOUT_A_FRAME or len(packet.payload) < _FRAME_ID.size:
        return None
    return int(_FRAME_ID.unpack_from(packet.payload)[0])
