"""A frame as packets: pixels encoded, cut into chunks, put together again."""

from __future__ import annotations

from typing import Any, Iterator, List, Optional, Set, Tuple, Union

import numpy as np

from hil.link.errors import PacketError
from hil.link.messages import Encoding, FrameChunk, FrameHeader

try:
    import zstandard
except ImportError:
    zstandard = None  # type: ignore[assignment]

Image = np.ndarray  # (H, W) uint8, or uint16 little-endian

# 16 bits, 16384 x 16384: no larger allocation is ever made for a header
MAX_FRAME_BYTES = 1 << 29


def supported_encodings() -> int:
    """Bit mask of what this machine can decode, ``1 << Encoding``."""
    return (1 << Encoding.RAW) | ((1 << Encoding.ZSTD) if zstandard is not None else 0)


def encode_image(image: Image, encoding: Encoding) -> bytes:
    """Pixels as bytes for the line, row by row, 16-bit ones little-endian."""
    raw = np.ascontiguousarray(image, dtype=image.dtype.newbyteorder("<")).tobytes()
    if encoding == Encoding.RAW:
        return raw
    if zstandard is None:
        raise PacketError("zstd was negotiated, but the package zstandard is not installed")
    return bytes(zstandard.ZstdCompressor(level=1).compress(raw))


def decode_image(data: Union[bytes, bytearray], header: FrameHeader) -> Image:
    """(H, W) image, read-only, from the bytes of its chunks.

    Raises
    ------
    PacketError
        If the bytes do not make an image of the size that the header says.
    """
    dtype = np.dtype("u1") if header.bits <= 8 else np.dtype("<u2")
    expected = header.width_px * header.height_px * dtype.itemsize
    raw: Any = data
    if header.encoding == Encoding.ZSTD:
        if zstandard is None:
            raise PacketError("zstd was negotiated, but the package zstandard is not installed")
        try:
            # the size is checked before anything is allocated
            if zstandard.frame_content_size(bytes(data[:32])) != expected:
                raise PacketError(f"frame {header.frame_id}: the compressed image has an unexpected size")
            raw = zstandard.ZstdDecompressor().decompress(data)
        except zstandard.ZstdError as error:
            raise PacketError(f"frame {header.frame_id}: the compressed image is damaged") from error
    if len(raw) != expected:
        raise PacketError(f"frame {header.frame_id}: {len(raw)} bytes of image, expected {expected}")
    image = np.frombuffer(raw, dtype=dtype).reshape(header.height_px, header.width_px)
    image.flags.writeable = False
    return image


def chunks(frame_id: int, data: bytes, chunk_bytes: int) -> Iterator[FrameChunk]:
    """The image's bytes cut into chunks."""
    for index, offset in enumerate(range(0, len(data), chunk_bytes)):
        yield FrameChunk(frame_id, index, offset, data[offset : offset + chunk_bytes])


def chunk_count(total_bytes: int, chunk_bytes: int) -> int:
    """How many chunks ``chunks`` yields."""
    return -(-total_bytes // chunk_bytes)


class FrameAssembler:
    """Header and chunks back to a frame; knows which frame was lost when something is missing.

    ``header`` and ``chunk`` return what became complete, ``lost`` which frames never will.
    """

    def __init__(self) -> None:
        self._header: Optional[FrameHeader] = None
        self._data = bytearray()
        self._seen: Set[int] = set()
        self._last_lost: Optional[int] = None
        self._lost: List[int] = []

    @property
    def frame_id(self) -> Optional[int]:
        """The frame that is being put together."""
        return self._header.frame_id if self._header else None

    def header(self, header: FrameHeader) -> None:
        """A new frame begins; one that was not complete is lost."""
        self.abandon()
        if not 0 < header.total_bytes <= MAX_FRAME_BYTES:
            raise PacketError(f"frame {header.frame_id}: a frame of {header.total_bytes} bytes is refused")
        self._header = header
        self._data = bytearray(header.total_bytes)
        self._seen = set()

    def chunk(self, chunk: FrameChunk) -> Optional[Tuple[FrameHeader, Image]]:
        """Take a chunk; the frame, when this was its last missing one."""
        header = self._header
        if header is None or chunk.frame_id != header.frame_id:
            self._lose(chunk.frame_id)  # its header never came
            return None
        end = chunk.offset + len(chunk.data)
        if chunk.index >= header.chunk_count or end > header.total_bytes:
            self.abandon()
            return None
        self._data[chunk.offset : end] = chunk.data
        self._seen.add(chunk.index)
        if len(self._seen) < header.chunk_count:
            return None
        self._header = None
        try:
            return header, decode_image(self._data, header)
        except PacketError:
            self._lose(header.frame_id)
            raise

    def abandon(self) -> None:
        """Give up the frame in work: a part of it was damaged."""
        if self._header is not None:
            self._lose(self._header.frame_id)
            self._header = None

    @property
    def has_lost(self) -> bool:
        """Whether ``lost`` has something to name."""
        return bool(self._lost)

    def lost(self) -> List[int]:
        """Frames lost since the last call, each named once."""
        lost, self._lost = self._lost, []
        return lost

    def _lose(self, frame_id: int) -> None:
        # every chunk of a frame without header comes by here: name it once
        if frame_id != self._last_lost:
            self._last_lost = frame_id
            self._lost.append(frame_id)
