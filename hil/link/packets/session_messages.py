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
    MAX_CAMERA_JSON_BYTES,
    known_value,
    pack_hash,
    pack_json,
    pack_text,
    unpack_fixed,
    unpack_hash,
    unpack_json,
    unpack_text,
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
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HHHH64s32s32s64s")
    BOARD_BYTES: ClassVar[int] = 64

    encodings: int = 1
    window: int = 1
    model_name: str = ""
    model_sha256: str = ""
    method: str = ""
    board: str = ""
    pixel_formats: int = format_mask(GREY_FORMATS)
    takes_fields: bool = False

    def encode(self) -> bytes:
        """Return the payload bytes."""
        return self.LAYOUT.pack(
            PROTOCOL_VERSION,
            self.encodings | (TAKES_FIELDS if self.takes_fields else 0),
            self.window,
            self.pixel_formats,
            pack_text(self.model_name, 64),
            pack_hash(self.model_sha256),
            pack_text(self.method, 32),
            pack_text(self.board, self.BOARD_BYTES),
        )

    @classmethod
    def decode(cls, data: bytes) -> Hello:
        """Return the message of a payload."""
        _, encodings, window, formats, name, digest, method, board = unpack_fixed(cls.LAYOUT, data, "HELLO")
        return cls(
            encodings & ~TAKES_FIELDS,
            window,
            unpack_text(name),
            unpack_hash(digest),
            unpack_text(method),
            unpack_text(board),
            formats,
            bool(encodings & TAKES_FIELDS),
        )


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
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HHIBBBBHHI64s32sI")

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
        """Return the payload bytes."""
        camera = pack_json(self.camera)
        fixed = self.LAYOUT.pack(
            self.width_px,
            self.height_px,
            self.pixel_format,
            self.bits,
            self.encoding,
            self.mode,
            self.truth,
            self.window,
            self.takes_fields,
            self.chunk_bytes,
            pack_text(self.target_name, 64),
            pack_hash(self.target_sha256),
            len(camera),
        )
        return fixed + camera

    @classmethod
    def decode(cls, data: bytes) -> HelloAck:
        """Return the message of a payload.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        values = unpack_fixed(cls.LAYOUT, data, "HELLO_ACK", tail=True)
        width, height, pixel_format, bits, encoding, mode, truth, window, flags = values[:9]
        chunk, name, digest, size = values[9:]
        camera = data[cls.LAYOUT.size :]
        if len(camera) != size:
            raise PacketError(f"a HELLO_ACK carries {len(camera)} bytes of camera, expected {size}")
        return cls(
            unpack_json(camera, MAX_CAMERA_JSON_BYTES),
            width,
            height,
            bits,
            known_value(Encoding, encoding, "image encoding"),
            known_value(Mode, mode, "mode"),
            known_value(TruthPolicy, truth, "truth policy"),
            window,
            chunk,
            unpack_text(name),
            unpack_hash(digest),
            known_value(PixelFormat, pixel_format, "pixel format"),
            bool(flags & 1),
        )


@dataclass(frozen=True)
class TimeSyncRequest:
    """Request for the other side's clock, with the sender's monotonic clock [ns]."""

    TYPE: ClassVar[PacketType] = PacketType.TIME_SYNC_REQUEST
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Q")

    asked_ns: int

    def encode(self) -> bytes:
        """Return the payload bytes."""
        return self.LAYOUT.pack(self.asked_ns)

    @classmethod
    def decode(cls, data: bytes) -> TimeSyncRequest:
        """Return the message of a payload."""
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
        """Return the payload bytes."""
        has_newest = self.newest_frame is not None
        newest = NO_FRAME if self.newest_frame is None else self.newest_frame
        return self.LAYOUT.pack(self.asked_ns, self.received_ns, self.sent_ns, newest, has_newest)

    @classmethod
    def decode(cls, data: bytes) -> TimeSyncReply:
        """Return the message of a payload."""
        asked_ns, received, sent, newest, has_newest = unpack_fixed(cls.LAYOUT, data, "TIME_SYNC_REPLY")
        return cls(asked_ns, received, sent, newest if has_newest else None)


@dataclass(frozen=True)
class Bye:
    """End of the session; the sender closes the line after it."""

    TYPE: ClassVar[PacketType] = PacketType.BYE
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HH")

    reason: str = ""

    def encode(self) -> bytes:
        """Return the payload bytes."""
        text = pack_text(self.reason, 400)
        return self.LAYOUT.pack(len(text), 0) + text

    @classmethod
    def decode(cls, data: bytes) -> Bye:
        """Return the message of a payload.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        size, _ = unpack_fixed(cls.LAYOUT, data, "BYE", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"a BYE payload has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(unpack_text(data[cls.LAYOUT.size :]))


@dataclass(frozen=True)
class ErrorMessage:
    """Error as a sentence, about a frame or none (``NO_FRAME``)."""

    TYPE: ClassVar[PacketType] = PacketType.ERROR
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HHI")

    code: ErrorCode
    text: str
    frame_id: int = NO_FRAME

    def encode(self) -> bytes:
        """Return the payload bytes."""
        text = pack_text(self.text, 400)
        return self.LAYOUT.pack(self.code, len(text), self.frame_id) + text

    @classmethod
    def decode(cls, data: bytes) -> ErrorMessage:
        """Return the message of a payload.

        Raises
        ------
        PacketError
            If the payload has another length or impossible values.
        """
        code, size, frame_id = unpack_fixed(cls.LAYOUT, data, "ERROR", tail=True)
        if len(data) - cls.LAYOUT.size != size:
            raise PacketError(f"an ERROR payload has {len(data) - cls.LAYOUT.size} bytes, expected {size}")
        return cls(known_value(ErrorCode, code, "error code"), unpack_text(data[cls.LAYOUT.size :]), frame_id)
