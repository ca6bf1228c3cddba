"""Messages that open, synchronise and close a session."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, ClassVar, Dict, Optional

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.enums import (
    GREY_FORMATS,
    NO_FRAME,
    Encoding,
    ErrorCode,
    Mode,
    PixelFormat,
    TruthPolicy,
    format_mask,
)
from flyaround.hil.link.packets.fields import (
    HASH,
    MAX_CAMERA_JSON_BYTES,
    MAX_TEXT_BYTES,
    FixedLayout,
    WireField,
    known_value,
    pack_json,
    pack_text,
    unpack_fixed,
    unpack_json,
    unpack_sentence,
    wire_enum,
    wire_text,
)
from flyaround.hil.link.packets.packet import PROTOCOL_VERSION, PacketType

TAKES_FIELDS = 0x8000
"""Bit of HELLO's encodings: the board reads optional fields. Older hosts interpret it as an unknown encoding."""


@dataclass(frozen=True)
class Hello:
    """Board to host, first message: identity and capabilities of the board.

    Parameters
    ----------
    encodings : int, optional
        Supported encodings, bit mask of ``1 << Encoding``.
    window : int, optional
        Number of frames that the board can hold, including the one being processed.
    model_name : str, optional
        Name of its target model.
    model_sha256 : str, optional
        Hash of its target model; an empty hash is not checked.
    method : str, optional
        Name of the estimator.
    board : str, optional
        Free text that describes the board.
    pixel_formats : int, optional
        Supported pixel formats, bit mask in the order of ``PIXEL_FORMATS``.
    takes_fields : bool, optional
        True if it reads the optional fields of FRAME_HEADER.
    """

    TYPE: ClassVar[PacketType] = PacketType.HELLO
    BOARD_BYTES: ClassVar[int] = 64
    LAYOUT: ClassVar[FixedLayout] = FixedLayout(
        protocol="H",
        encodings="H",
        window="H",
        pixel_formats="H",
        model_name=wire_text(64),
        model_sha256=HASH,
        method=wire_text(32),
        board=wire_text(BOARD_BYTES),
    )

    encodings: int = 1
    window: int = 1
    model_name: str = ""
    model_sha256: str = ""
    method: str = ""
    board: str = ""
    pixel_formats: int = format_mask(GREY_FORMATS)
    takes_fields: bool = False

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed-size payload with this version of the protocol.
        """
        encodings = self.encodings | (TAKES_FIELDS if self.takes_fields else 0)
        return self.LAYOUT.pack({**vars(self), "protocol": PROTOCOL_VERSION, "encodings": encodings})

    @classmethod
    def decode(cls, data: bytes) -> Hello:
        """Decode the message of a payload.

        Returns
        -------
        Hello
            Message; its protocol version is not kept.

        Raises
        ------
        PacketError
            If the payload has another length or a text is not UTF-8.
        """
        values = cls.LAYOUT.unpack(data, "HELLO")
        del values["protocol"]
        encodings = values.pop("encodings")
        return cls(encodings & ~TAKES_FIELDS, takes_fields=bool(encodings & TAKES_FIELDS), **values)


@dataclass(frozen=True)
class HelloAck:
    """Host to board: terms of the session; its packet carries the session id.

    Parameters
    ----------
    camera : dict of str to object
        Camera JSON object (CAMERA.json).
    width_px : int
        Image width.
    height_px : int
        Image height.
    bits : int, optional
        Bits per pixel of the detector; the pixel format holds at least as many.
    encoding : Encoding, optional
        Compression, chosen from those that the board offered.
    mode : Mode, optional
        Pace of the session: lockstep or real time.
    truth : TruthPolicy, optional
        Whether, and when, the host sends the truth.
    window : int, optional
        Number of frames that may be in transit or in progress at once (credits).
    chunk_bytes : int, optional
        Largest number of pixel bytes in a FRAME_CHUNK.
    target_name : str, optional
        Name of the host's target.
    target_sha256 : str, optional
        Hash of the host's target; an empty hash is not checked.
    pixel_format : PixelFormat, optional
        Pixel format of the images.
    takes_fields : bool, optional
        True if the optional fields of FRAME_HEADER and POSE are agreed.
    """

    TYPE: ClassVar[PacketType] = PacketType.HELLO_ACK
    LAYOUT: ClassVar[FixedLayout] = FixedLayout(
        width_px="H",
        height_px="H",
        pixel_format=wire_enum(PixelFormat, "I", "pixel format"),
        bits="B",
        encoding=wire_enum(Encoding, "B", "image encoding"),
        mode=wire_enum(Mode, "B", "mode"),
        truth=wire_enum(TruthPolicy, "B", "truth policy"),
        window="H",
        takes_fields=WireField("H", int, lambda flags: bool(flags & 1)),
        chunk_bytes="I",
        target_name=wire_text(64),
        target_sha256=HASH,
        camera_bytes="I",
    )

    camera: Dict[str, Any]
    width_px: int
    height_px: int
    bits: int = 8
    encoding: Encoding = Encoding.RAW
    mode: Mode = Mode.LOCKSTEP
    truth: TruthPolicy = TruthPolicy.OFF
    window: int = 1
    chunk_bytes: int = 1 << 18
    target_name: str = ""
    target_sha256: str = ""
    pixel_format: PixelFormat = PixelFormat.Mono8
    takes_fields: bool = False

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the camera as JSON.
        """
        camera = pack_json(self.camera)
        return self.LAYOUT.pack({**vars(self), "camera_bytes": len(camera)}) + camera

    @classmethod
    def decode(cls, data: bytes) -> HelloAck:
        """Decode the message of a payload.

        Returns
        -------
        HelloAck
            Message with the camera as a dictionary. Sizes and bits are left to `images.check_terms`; a window of 0
            counts as 1.

        Raises
        ------
        PacketError
            If the payload has another length, an unknown enumerator, text that is not UTF-8, or no JSON camera.
        """
        values, camera = cls.LAYOUT.unpack(data, "HELLO_ACK", tail=True), data[cls.LAYOUT.size :]
        size = values.pop("camera_bytes")
        if len(camera) != size:
            raise PacketError(f"a HELLO_ACK carries {len(camera)} bytes of camera, expected {size}")
        return cls(unpack_json(camera, MAX_CAMERA_JSON_BYTES), **values)


@dataclass(frozen=True)
class TimeSyncRequest:
    """Request for the other side's clock, with the sender's monotonic clock [ns]."""

    TYPE: ClassVar[PacketType] = PacketType.TIME_SYNC_REQUEST
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Q")

    asked_ns: int

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Payload of 8 bytes.
        """
        return self.LAYOUT.pack(self.asked_ns)

    @classmethod
    def decode(cls, data: bytes) -> TimeSyncRequest:
        """Decode the message of a payload.

        Returns
        -------
        TimeSyncRequest
            Message with the sender's clock [ns].

        Raises
        ------
        PacketError
            If the payload has another length.
        """
        return cls(*unpack_fixed(cls.LAYOUT, data, "TIME_SYNC_REQUEST"))


@dataclass(frozen=True)
class TimeSyncReply:
    """Reply: time of the request, and the answering clock at reception and at sending [ns].

    Parameters
    ----------
    asked_ns : int
        Time of the request, clock of the side that asked.
    received_ns : int
        Reception of the request, clock of the side that answers.
    sent_ns : int
        Sending of the reply, clock of the side that answers.
    newest_frame : int, optional
        Last frame that the replying side received completely, ``NO_FRAME`` before the first. If the request followed a
        later frame, that frame was lost. None if it is not reported.
    """

    TYPE: ClassVar[PacketType] = PacketType.TIME_SYNC_REPLY
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<QQQII")

    asked_ns: int
    received_ns: int
    sent_ns: int
    newest_frame: Optional[int] = None

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Payload of 32 bytes.
        """
        has_newest = self.newest_frame is not None
        newest = NO_FRAME if self.newest_frame is None else self.newest_frame
        return self.LAYOUT.pack(self.asked_ns, self.received_ns, self.sent_ns, newest, has_newest)

    @classmethod
    def decode(cls, data: bytes) -> TimeSyncReply:
        """Decode the message of a payload.

        Returns
        -------
        TimeSyncReply
            Message; ``newest_frame`` is None if the sender does not report it.

        Raises
        ------
        PacketError
            If the payload has another length.
        """
        asked_ns, received, sent, newest, has_newest = unpack_fixed(cls.LAYOUT, data, "TIME_SYNC_REPLY")
        return cls(asked_ns, received, sent, newest if has_newest else None)


@dataclass(frozen=True)
class Bye:
    """End of the session; the sender closes the line after it."""

    TYPE: ClassVar[PacketType] = PacketType.BYE
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HH")

    reason: str = ""

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the reason as UTF-8, cut to ``MAX_TEXT_BYTES``.
        """
        text = pack_text(self.reason, MAX_TEXT_BYTES)
        return self.LAYOUT.pack(len(text), 0) + text

    @classmethod
    def decode(cls, data: bytes) -> Bye:
        """Decode the message of a payload.

        Returns
        -------
        Bye
            Message with the reason, cut to ``MAX_TEXT_BYTES``.

        Raises
        ------
        PacketError
            If the payload has another length or the reason is not UTF-8.
        """
        size, _ = unpack_fixed(cls.LAYOUT, data, "BYE", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"a BYE payload has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(unpack_sentence(data[cls.LAYOUT.size :]))


@dataclass(frozen=True)
class ErrorMessage:
    """Error as a sentence, about a frame or none (``NO_FRAME``)."""

    TYPE: ClassVar[PacketType] = PacketType.ERROR
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HHI")

    code: ErrorCode
    text: str
    frame_id: int = NO_FRAME

    def encode(self) -> bytes:
        """Encode the message as a payload.

        Returns
        -------
        bytes
            Fixed fields, then the text as UTF-8, cut to ``MAX_TEXT_BYTES``.
        """
        text = pack_text(self.text, MAX_TEXT_BYTES)
        return self.LAYOUT.pack(self.code, len(text), self.frame_id) + text

    @classmethod
    def decode(cls, data: bytes) -> ErrorMessage:
        """Decode the message of a payload.

        Returns
        -------
        ErrorMessage
            Message with its code, frame, and text cut to ``MAX_TEXT_BYTES``.

        Raises
        ------
        PacketError
            If the payload has another length, the code is unknown, or the text is not UTF-8.
        """
        code, size, frame_id = unpack_fixed(cls.LAYOUT, data, "ERROR", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"an ERROR payload has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(
            known_value(ErrorCode, code, "error code"), unpack_sentence(data[cls.LAYOUT.size :]), frame_id
        )
