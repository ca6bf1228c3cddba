"""Pictures of two greys as PNG files whose bytes are the same with every version of every library."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from simulator.runtime.arrays import BoolArray

BLOCK_BYTES = 65_535


def two_tone_png(dark: BoolArray, greys: tuple[int, int]) -> bytes:
    """A PNG of one bit per pixel.

    Parameters
    ----------
    dark : (H, W), True where the first grey is. greys : dark and light, 0..255 (sRGB).

    Notes
    -----
    The pixels are stored, not compressed: what a compressor makes of them depends on its version, and a target's
    hash must not. PNG specification (W3C 2003), sections 10 and 11; stored blocks of RFC 1951, section 3.2.4.
    """
    height, width = dark.shape
    rows = np.packbits(~np.asarray(dark, bool), axis=1)
    raw = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    blocks = [raw[k : k + BLOCK_BYTES] for k in range(0, len(raw), BLOCK_BYTES)]
    stored = b"".join(
        struct.pack("<BHH", k == len(blocks) - 1, len(b), 0xFFFF - len(b)) + b for k, b in enumerate(blocks)
    )
    palette = bytes(grey for grey in greys for _ in range(3))
    stream = b"\x78\x01" + stored + struct.pack(">I", zlib.adler32(raw))
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 3, 0, 0, 0))
        + _chunk(b"PLTE", palette)
        + _chunk(b"IDAT", stream)
        + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
