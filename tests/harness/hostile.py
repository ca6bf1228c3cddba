"""Bytes that a link must survive: packets cut, flipped, sealed again with lies inside, nested, and bombs; by seed."""

from __future__ import annotations

import random
import struct
import zlib
from functools import cache
from typing import TYPE_CHECKING

import zstandard

from flyaround.hil.link.framing.length_prefix import PREFIX
from flyaround.hil.link.packets.messages import Encoding, FrameChunk, FrameHeader
from flyaround.hil.link.packets.packet import (
    HEADER,
    MAGIC,
    OVERHEAD_BYTES,
    PROTOCOL_VERSION,
    Packet,
    PacketType,
    encode_packet,
)
from tools.docs.link_vectors import EXAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

BYTES = [b"\0", b"\xff", b"\x7f", b"\x80", b"\x01", b"\r", b"\x1b"]
NUMBERS = [
    *(struct.pack("<d", x) for x in (float("nan"), float("inf"), -float("inf"), 1e308, -0.0, 5e-324)),
    *(struct.pack("<I", x) for x in (0, 1, 2**31, 2**32 - 1)),
    *(struct.pack("<H", x) for x in (0, 2**15, 2**16 - 1)),
    struct.pack("<Q", 2**64 - 1),
]
JSON = [
    b"[" * 100_000,
    b'{"a":' * 60_000 + b"1" + b"}" * 60_000,
    b'{"width_px":' + b"[" * 2000 + b"]" * 2000 + b"}",
    b'{"width_px":1' + b"0" * 5000 + b"}",
    b'{"width_px":' + b"9" * 4000 + b',"height_px":1e999}',
    b'{"width_px":-64,"height_px":NaN}',
    b'{"distortion":{"model":"none","coefficients":[' + b"0," * 30_000 + b"0]}}",
    b'{"' + b"\\u0000" * 100 + b'":"\\ud800"}',
    b'{"a":"' + b'\\"' * 30_000,
    b"\xff\xfe{}",
    b"[1]",
    b"null",
    b'""' * 30_000,
    b"",
]


@cache
def packed(size: int, *, told: bool) -> bytes:
    """Zeros, as zstd packs them."""
    return bytes(zstandard.ZstdCompressor(level=1, write_content_size=told).compress(bytes(size)))


def sealed(
    kind: int, payload: bytes, session_id: int = 0, sequence: int = 0, version: int = PROTOCOL_VERSION
) -> bytes:
    """A packet on the line whose CRC is right, whatever it says."""
    header = HEADER.pack(MAGIC, version, kind, 0, session_id, sequence, len(payload))
    data = header + payload + struct.pack("<I", zlib.crc32(header + payload))
    return PREFIX.pack(len(data)) + data


class Hostile:
    """Hostile bytes for one side of the link.

    Parameters
    ----------
    seed : the same seed, the same bytes.
    end_of_session : types that rightly end a session; they are damaged, but never sealed again.
    """

    def __init__(self, seed: int, end_of_session: Collection[PacketType] = ()) -> None:
        self.rng = random.Random(seed)
        self.session_id = 0
        self.frame_id = 0
        self.allowed = [m for _, m in EXAMPLES if m.TYPE not in end_of_session]
        self.kinds: dict[str, Callable[[], bytes]] = {
            "flipped": self.flipped,
            "cut": self.cut,
            "changed": self.changed,
            "extreme": self.extreme,
            "resized": self.resized,
            "noise": self.noise,
            "json": self.json,
            "nested": self.nested,
            "garbage": self.garbage,
            "bomb": self.bomb,
        }

    def bytes(self) -> bytes:
        """Some of a kind chosen by chance."""
        return self.kinds[self.rng.choice(list(self.kinds))]()

    def packet(self, message, payload: bytes) -> bytes:
        """Of this session mostly, now and then of another or of none."""
        session_id = self.rng.choice([self.session_id] * 6 + [0, 2**64 - 1])
        return sealed(message.TYPE, payload, session_id, self.rng.randrange(2**32))

    def payload(self, message) -> bytearray:
        """What the message says, about the frame of the hour where it is about one."""
        data = bytearray(message.encode())
        if message.TYPE in (
            PacketType.POSE,
            PacketType.CREDIT,
            PacketType.FRAME_CHUNK,
            PacketType.FRAME_HEADER,
        ):
            data[:4] = struct.pack("<I", self.frame_id)
        return data

    def flipped(self) -> bytes:
        data = bytearray(self.packet(message := self.any(), self.payload(message)))
        for _ in range(self.rng.randrange(1, 8)):
            data[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        return bytes(data)

    def cut(self) -> bytes:
        data = self.packet(message := self.any(), self.payload(message))
        return data[: self.rng.randrange(len(data))]

    def changed(self) -> bytes:
        data = self.payload(message := self.any_allowed())
        for _ in range(self.rng.randrange(1, 6)):
            data[self.rng.randrange(len(data))] = self.rng.choice(BYTES)[0]
        return self.packet(message, bytes(data))

    def extreme(self) -> bytes:
        data = self.payload(message := self.any_allowed())
        for _ in range(self.rng.randrange(1, 4)):
            number = self.rng.choice(NUMBERS)
            at = 4 * self.rng.randrange(len(data) // 4 + 1)
            data[at : at + len(number)] = number
        return self.packet(message, bytes(data))

    def resized(self) -> bytes:
        data = self.payload(message := self.any_allowed())
        size = self.rng.choice([0, 1, 7, len(data) - 1, len(data) + 1, 70_000])
        return self.packet(message, bytes(data[:size]).ljust(size, self.rng.choice(BYTES)))

    def noise(self) -> bytes:
        kinds = [*{m.TYPE for m in self.allowed}, 0, 12, 255]
        session_id = self.rng.choice([self.session_id, 0])
        return sealed(self.rng.choice(kinds), self.rng.randbytes(self.rng.randrange(300)), session_id)

    def json(self) -> bytes:
        text = self.rng.choice(JSON)
        if self.rng.random() < 0.5:
            return sealed(
                PacketType.TRUTH, struct.pack("<II", self.frame_id, len(text)) + text, self.session_id
            )
        return self.camera(self.rng.randrange(len(JSON)))

    def camera(self, k: int) -> bytes:
        """Terms whose camera is the k-th of hostile texts."""
        text = JSON[k % len(JSON)]
        fixed = struct.pack("<HHBBBBHHI64s32sI", 64, 48, 8, 0, 0, 2, 1, 0, 1 << 18, b"", b"", len(text))
        return sealed(PacketType.HELLO_ACK, fixed + text, self.session_id)

    def nested(self) -> bytes:
        size, out = PREFIX.size + HEADER.size, bytearray()
        total = size * self.rng.randrange(10, 2000)
        for left in range(total, size + 4, -size):
            length = left - PREFIX.size
            out += PREFIX.pack(length)
            out += HEADER.pack(MAGIC, 2, PacketType.TRUTH, 0, self.session_id, 0, length - OVERHEAD_BYTES)
        return bytes(out)

    def garbage(self) -> bytes:
        parts = [b"FLYA", b"FLY", b"\0\0\0\0", PREFIX.pack(28), b"FLYA\x01\0\x09\0", self.rng.randbytes(50)]
        return b"".join(self.rng.choices(parts, k=self.rng.randrange(1, 60)))

    def bomb(self) -> bytes:
        """A header of the largest picture, or of one as agreed, and what unpacks to far more."""
        big = self.rng.random() < 0.5
        width, height, bits = (65535, 65535, 16) if big else (64, 48, 8)
        size = self.rng.choice([1 << 24, 64 * 48, 64 * 48 + 1])
        told = self.rng.random() < 0.7
        data = packed(size, told=told)
        total = self.rng.choice([len(data), len(data), 2**32 - 1, 0])
        count = self.rng.choice([1, 1, 2**32 - 1, 0])
        header = FrameHeader(
            self.frame_id, width, height, bits, Encoding.ZSTD, total, count, 0.01, 0.0, 1, "2026"
        )
        chunk = FrameChunk(self.frame_id, 0, 0, data)
        return b"".join(sealed(m.TYPE, m.encode(), self.session_id) for m in (header, chunk))

    def any(self):
        return self.rng.choice(EXAMPLES)[1]

    def any_allowed(self):
        return self.rng.choice(self.allowed)


def line(message, session_id: int, sequence: int = 0) -> bytes:
    """A message as it goes over TCP."""
    data = encode_packet(Packet(message.TYPE, message.encode(), session_id, sequence))
    return PREFIX.pack(len(data)) + data
