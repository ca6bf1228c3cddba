"""GVSP packets: an image as leader, payload packets and trailer. Big-endian headers, little-endian pixels.

Layouts from public material: Wireshark's ``packet-gvsp.c`` and Aravis's ``arvgvsp.h``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.link.packets.enums import PixelFormat
from flyaround.hil.link.packets.pixels import pack_pixels

if TYPE_CHECKING:
    from numpy.typing import NDArray

HEADER = struct.Struct(">HHI")

IP_UDP_BYTES = 28
"""IP and UDP headers, which a stream channel's packet size includes [bytes]."""

# Payload type of an image.
IMAGE_PAYLOAD = 1

LEADER, TRAILER, DATA = 1, 2, 3
"""Packet formats."""

RESENT, UNAVAILABLE = 0x0100, 0x800C
"""Status of a resent packet, and of one that is no longer available."""


class StreamFormat(IntEnum):
    """Codes of the Pixel Format Naming Convention: size of a pixel and format number."""

    Mono8 = 0x01080001
    Mono10 = 0x01100003
    Mono12 = 0x01100005
    Mono12p = 0x010C0047
    Mono14 = 0x01100025
    Mono16 = 0x01100007

    @property
    def bits(self) -> int:
        """Significant bits per pixel."""
        return int(self.name[4:].rstrip("p"))

    def payload_bytes(self, n_pixels: int) -> int:
        """Return the size of ``n_pixels`` pixels [bytes]; the code's third byte is the bits per pixel."""
        return -(-n_pixels * (self >> 16 & 0xFF) // 8)


def formats_of(bits: int) -> tuple[StreamFormat, ...]:
    """Return the formats of a detector of that depth: its own, packed for 12 bits, and 8 bits."""
    native = next(f for f in StreamFormat if f.bits >= bits)
    packed = (StreamFormat.Mono12p,) if native is StreamFormat.Mono12 else ()
    return tuple(dict.fromkeys((native, *packed, StreamFormat.Mono8)))


@dataclass(frozen=True, kw_only=True)
class ReadoutRegion:
    """Region of the detector that is read [px]."""

    x: int
    y: int
    width: int
    height: int


def pixels_of(
    image: NDArray[np.unsignedinteger], bits: int, region: ReadoutRegion, pixel_format: StreamFormat
) -> bytes:
    """Return the bytes of a region of digital numbers (H, W) with ``bits`` bits, row by row, in a pixel format."""
    part = image[region.y : region.y + region.height, region.x : region.x + region.width]
    more = pixel_format.bits - bits
    if pixel_format is StreamFormat.Mono8:
        return ((part >> -more) if more < 0 else (part << more)).astype(np.uint8).tobytes()
    words = (part.astype("<u2") << more).astype("<u2")
    if pixel_format is StreamFormat.Mono12p:
        return pack_pixels(words, PixelFormat.Mono12p)
    return words.tobytes()


@dataclass(frozen=True, kw_only=True)
class Block:
    """Image in transmission.

    Parameters
    ----------
    block_id : int
        Block identifier, 1 to 65535.
    timestamp_ns : int
        Start of the exposure.
    pixel_format : StreamFormat
        Pixel format on the line.
    region : ReadoutRegion
        Region of the detector that was read.
    data : bytes
        Pixels of the image.
    packet_bytes : int
        Size of each packet, including IP and UDP headers.
    """

    block_id: int
    timestamp_ns: int
    pixel_format: StreamFormat
    region: ReadoutRegion
    data: bytes
    packet_bytes: int

    @property
    def data_bytes(self) -> int:
        """Pixel bytes in each packet but the last."""
        return self.packet_bytes - IP_UDP_BYTES - HEADER.size

    @property
    def n_packets(self) -> int:
        """Number of packets, including leader and trailer."""
        return -(-len(self.data) // self.data_bytes) + 2

    def packet(self, number: int, status: int = 0) -> bytes:
        """Return the packet with a number from 0 to ``n_packets - 1``."""
        if number == 0:
            return self._header(LEADER, 0, status) + self._leader()
        if number == self.n_packets - 1:
            return self._header(TRAILER, number, status) + struct.pack(
                ">HHI", 0, IMAGE_PAYLOAD, self.region.height
            )
        start = (number - 1) * self.data_bytes
        return self._header(DATA, number, status) + self.data[start : start + self.data_bytes]

    def _header(self, packet_format: int, number: int, status: int) -> bytes:
        return HEADER.pack(status, self.block_id, packet_format << 24 | number)

    def _leader(self) -> bytes:
        r = self.region
        return struct.pack(
            ">HHQIIIIIHH",
            0,
            IMAGE_PAYLOAD,
            self.timestamp_ns,
            self.pixel_format,
            r.width,
            r.height,
            r.x,
            r.y,
            0,
            0,
        )


def unavailable(block_id: int, number: int) -> bytes:
    """Return the answer to a request for a packet that is not available."""
    return HEADER.pack(UNAVAILABLE, block_id, DATA << 24 | number)


def packet_for_size(packet_bytes: int) -> bytes:
    """Return a packet of one size, including IP and UDP headers, with which a controller probes the line."""
    return HEADER.pack(0, 0, DATA << 24).ljust(packet_bytes - IP_UDP_BYTES, b"\0")
