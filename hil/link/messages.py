"""What payloads say: one frozen dataclass per packet type, with its struct layout beside it."""

from __future__ import annotations

from typing import Any, Dict, Union, get_args

from hil.link.messages_frame import Credit, FrameChunk, FrameHeader, PoseMessage, TruthMessage
from hil.link.messages_session import Bye, ErrorMessage, Hello, HelloAck, TimeSyncReply, TimeSyncRequest
from hil.link.packets import Packet, PacketType
from hil.link.vocabulary import NO_FRAME, Encoding, ErrorCode, Mode, TruthPolicy

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
    "PoseMessage",
    "TimeSyncReply",
    "TimeSyncRequest",
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


def decode_message(packet: Packet) -> Message:
    """The message in a packet.

    Raises
    ------
    PacketError
        If the payload is not what its type says.
    """
    message: Message = _BY_TYPE[packet.type].decode(packet.payload)
    return message
