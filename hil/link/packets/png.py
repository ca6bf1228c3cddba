"""PNG by zlib and NumPy, for boards without OpenCV: 8 and 16-bit grey, and 8-bit RGB.

Writes the filters None and Sub; reads None, Sub and Up, as written by `encode` and simple encoders.
Reference: ISO/IEC 15948:2004, Portable Network Graphics, sections 5, 9 and 11.
"""

from __future__ import annotations

import struct
import zlib
from typing import Iterator, List, Tuple, Union

import numpy as np

from flyaround.hil.link.errors import PacketError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = struct.Struct(">I4s")
_CRC = struct.Struct(">I")
_IHDR = struct.Struct(">IIBBBBB")

# Colour types and row filters of PNG (RFC 2083).
_GREY, _RGB = 0, 2
_NONE, _SUB, _UP = 0, 1, 2

Bytes = Union[bytes, bytearray, memoryview]


def encode(image: np.ndarray, level: int = 1) -> bytes:
    """Encode an image, (H, W) uint8 or uint16, or (H, W, 3) uint8.

    Each row uses the filter (None or Sub) with the smaller sum of absolute bytes, as the standard recommends.
    """
    height, width = image.shape[:2]
    wide = image.dtype.itemsize == 2
    rows = np.ascontiguousarray(image, dtype=">u2" if wide else "u1").view(np.uint8).reshape(height, -1)
    step = (3 if image.ndim == 3 else 1) * image.dtype.itemsize
    differences = rows.copy()
    differences[:, step:] -= rows[:, :-step]
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    subtract = _weight(differences) < _weight(rows)
    filtered[:, 0] = np.where(subtract, _SUB, _NONE)
    filtered[:, 1:] = np.where(subtract[:, None], differences, rows)
    head = _IHDR.pack(width, height, 8 * image.dtype.itemsize, _RGB if image.ndim == 3 else _GREY, 0, 0, 0)
    parts = (
        (b"IHDR", head),
        (b"IDAT", zlib.compress(filtered.tobytes(), level)),
        (b"IEND", b""),
    )
    return SIGNATURE + b"".join(_chunk(kind, data) for kind, data in parts)


def max_bytes(width_px: int, height_px: int, bytes_per_pixel: int) -> int:
    """Return the maximum size of a PNG from `encode`, reached by incompressible data, which deflate stores."""
    raw = height_px * (1 + width_px * bytes_per_pixel)
    return raw + raw // 128 + 1024


def decode(data: Bytes, width_px: int, height_px: int, dtype: np.dtype, channels: int) -> np.ndarray:
    """Decode an image of known size and type, without unpacking more data than that.

    Raises
    ------
    PacketError
        If the file is damaged, has another size or type, is interlaced, or uses another filter.
    """
    step = channels * dtype.itemsize
    expected = (width_px, height_px, 8 * dtype.itemsize, _RGB if channels == 3 else _GREY, 0, 0, 0)
    packed: List[Bytes] = []
    head = None
    for kind, body in _chunks(memoryview(data)):
        if kind == b"IHDR" and len(body) == _IHDR.size:
            head = _IHDR.unpack(body)
        elif kind == b"IDAT":
            packed.append(body)
        elif kind == b"IEND":
            break
    if head != expected:
        raise PacketError(f"a PNG has {head}, agreed was {expected}")
    size = height_px * (1 + width_px * step)
    inflate = zlib.decompressobj()
    try:
        flat = inflate.decompress(b"".join(packed), size)
        if len(flat) != size or inflate.decompress(inflate.unconsumed_tail, 1):
            raise PacketError(f"a PNG unpacks to another size than {size} bytes")
    except zlib.error as error:
        raise PacketError(f"a PNG is damaged: {error}") from error
    rows = np.frombuffer(flat, np.uint8).reshape(height_px, -1)
    out = _unfilter(rows[:, 0], rows[:, 1:], step)
    wide = ">u2" if dtype.itemsize == 2 else "u1"
    shape = (height_px, width_px) if channels == 1 else (height_px, width_px, channels)
    return out.view(wide).reshape(shape).astype(dtype)


def _unfilter(filters: np.ndarray, rows: np.ndarray, step: int) -> np.ndarray:
    if np.any(filters > _UP):
        raise PacketError(f"a PNG has a row with filter {int(filters.max())}: write it with None, Sub or Up")
    lanes = rows.reshape(rows.shape[0], -1, step)
    out = np.array(lanes)
    subtracted = filters == _SUB
    out[subtracted] = np.cumsum(lanes[subtracted], axis=1, dtype=np.uint8)
    for row in np.flatnonzero(filters == _UP):
        if row:
            out[row] += out[row - 1]
    return out.reshape(rows.shape)


def _weight(rows: np.ndarray) -> np.ndarray:
    """Return the sum of the absolute values of each row's bytes, interpreted as signed."""
    return np.minimum(rows, np.negative(rows)).sum(axis=1, dtype=np.uint32)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return _CHUNK.pack(len(data), kind) + data + _CRC.pack(zlib.crc32(data, zlib.crc32(kind)))


def _chunks(data: memoryview) -> Iterator[Tuple[bytes, memoryview]]:
    if bytes(data[: len(SIGNATURE)]) != SIGNATURE:
        raise PacketError("an image has no PNG signature")
    offset = len(SIGNATURE)
    while offset + _CHUNK.size + _CRC.size <= len(data):
        size, kind = _CHUNK.unpack_from(data, offset)
        begin = offset + _CHUNK.size
        end = begin + size
        if end + _CRC.size > len(data):
            break
        # the packet's own CRC was correct: a mismatch here is an error of the encoder
        if zlib.crc32(data[offset + 4 : end]) != _CRC.unpack_from(data, end)[0]:
            raise PacketError("a PNG has a wrong CRC")
        yield kind, data[begin:end]
        offset = end + _CRC.size
    raise PacketError("a PNG is truncated")
