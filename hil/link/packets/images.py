"""Frames as packets: pixels encoded, cut into chunks and reassembled."""

from __future__ import annotations

from typing import Any, Iterator, List, Optional, Tuple, Union

import numpy as np

from flyaround.hil.link.errors import LinkError, PacketError, ProtocolMistake
from flyaround.hil.link.packets import png
from flyaround.hil.link.packets.enums import GREY_FORMATS, format_mask, formats_in
from flyaround.hil.link.packets.messages import Encoding, FrameChunk, FrameHeader, HelloAck, PixelFormat
from flyaround.hil.link.packets.pixels import Image, fits, pack_pixels, pixels_bytes, unpack_pixels

try:
    import zstandard
except ImportError:
    zstandard = None  # type: ignore[assignment]

# Largest accepted image [bytes]: 16 bits, 8192 x 8192
MAX_FRAME_BYTES = 1 << 27


def formats_of(bits: int, channels: int) -> Tuple[PixelFormat, ...]:
    """Return the pixel formats that hold an image of these bits and channels without loss.

    Returns
    -------
    tuple of PixelFormat
        Formats in order of preference; empty if none holds it, as for colours of more than 8 bits.
    """
    if channels == 3:
        return (PixelFormat.RGB8,) if bits <= 8 else ()
    holding = [f for f in GREY_FORMATS if f.depth_bits >= bits]
    # packed formats last: they cost both sides time, and compress worse
    return tuple(sorted(holding, key=lambda f: (f is PixelFormat.Mono12p, f.depth_bits)))


def array_bytes(width_px: int, height_px: int, pixel_format: PixelFormat) -> int:
    """Return the memory of an unpacked image [bytes]."""
    return width_px * height_px * pixel_format.channels * (2 if pixel_format.in_words else 1)


def max_encoded_bytes(width_px: int, height_px: int, pixel_format: PixelFormat, encoding: Encoding) -> int:
    """Return the largest valid size of an encoded image [bytes]."""
    raw = pixels_bytes(width_px, height_px, pixel_format)
    if encoding == Encoding.RAW:
        return raw
    if encoding == Encoding.PNG:
        return png.max_bytes(width_px, height_px, pixel_format.channels * (2 if pixel_format.in_words else 1))
    # upper bound of zstd's expansion on incompressible data
    return raw + raw // 128 + 1024


def check_terms(terms: HelloAck, encodings: int, pixel_formats: int = format_mask(PixelFormat)) -> None:
    """Check the terms that a host proposes before memory is allocated for them.

    Parameters
    ----------
    terms : HelloAck
        Terms of the host.
    encodings : int
        Encodings that this side offered in its HELLO.
    pixel_formats : int, optional
        Pixel formats that this side offered in its HELLO.

    Raises
    ------
    LinkError
        If the images have an invalid size, do not match the camera, or cannot be decoded here.
    """
    size = _describe(terms)
    total = array_bytes(terms.width_px, terms.height_px, terms.pixel_format)
    if total == 0 or not 1 <= terms.bits <= terms.pixel_format.depth_bits:
        raise LinkError(
            f"images of {size} cannot be sent: use 1 to {terms.pixel_format.depth_bits} bits in this format"
        )
    if total > MAX_FRAME_BYTES:
        raise LinkError(
            f"images of {size} are too large for this board: at most {MAX_FRAME_BYTES >> 20} MiB each"
        )
    for name, value in (("width_px", terms.width_px), ("height_px", terms.height_px)):
        if terms.camera.get(name, value) != value:
            raise LinkError(
                f"images of {size} do not fit the camera, whose {name} is {terms.camera[name]!r:.40}"
            )
    if not encodings & (1 << terms.encoding):
        raise LinkError(f"images are sent as {terms.encoding.name.lower()}, which this board did not offer")
    if terms.pixel_format not in formats_in(pixel_formats):
        raise LinkError(f"images are sent as {terms.pixel_format.name}, which this board did not offer")


def _describe(terms: Union[FrameHeader, HelloAck]) -> str:
    return f"{terms.width_px} x {terms.height_px} px of {terms.bits} bits as {terms.pixel_format.name}"


def check_header(header: FrameHeader, terms: HelloAck) -> None:
    """Raise unless a frame is as agreed in the handshake.

    Raises
    ------
    ProtocolMistake
        If its size, depth, pixel format, encoding or number of chunks differs, or more bytes are announced than its
        pixels need.
    """
    described, expected = _describe(header), _describe(terms)
    if described != expected:
        raise ProtocolMistake(
            f"frame {header.frame_id} has {described}, agreed were {expected}", header.frame_id
        )
    if header.encoding not in (terms.encoding, Encoding.RAW):
        raise ProtocolMistake(f"frame {header.frame_id} has an encoding that was not agreed", header.frame_id)
    max_bytes = max_encoded_bytes(header.width_px, header.height_px, header.pixel_format, header.encoding)
    if not 0 < header.total_bytes <= max_bytes:
        raise ProtocolMistake(
            f"frame {header.frame_id} announces {header.total_bytes} bytes but its pixels need at most {max_bytes}",
            header.frame_id,
        )


def supported_encodings() -> int:
    """Return the encodings that this machine can decode.

    Returns
    -------
    int
        Bit mask of ``1 << Encoding``; zstd only if the package zstandard is installed.
    """
    return (1 << Encoding.RAW) | (1 << Encoding.PNG) | ((1 << Encoding.ZSTD) if zstandard is not None else 0)


def encode_image(image: Image, encoding: Encoding, pixel_format: PixelFormat) -> bytes:
    """Encode an image for the line.

    Returns
    -------
    bytes
        Pixels as `pack_pixels` packs them, compressed if the encoding is zstd; for PNG, a PNG file.

    Raises
    ------
    PacketError
        If the image does not fit the format, or zstd is requested but not installed.
    """
    if encoding == Encoding.PNG:
        if not fits(image, pixel_format):
            raise PacketError(f"an image of type {image.dtype} does not fit {pixel_format.name}")
        return png.encode(image.astype(np.uint16 if pixel_format.in_words else np.uint8, copy=False))
    raw = pack_pixels(image, pixel_format)
    if encoding == Encoding.RAW:
        return raw
    if zstandard is None:
        raise PacketError("zstd was negotiated, but the package zstandard is not installed")
    return bytes(zstandard.ZstdCompressor(level=1).compress(raw))


def decode_image(data: Union[bytes, bytearray], header: FrameHeader) -> Image:
    """Return the read-only image, (H, W) or (H, W, 3), decoded from the bytes of its chunks.

    Raises
    ------
    PacketError
        If the bytes are not an image of the size in the header.
    """
    width, height, pixel_format = header.width_px, header.height_px, header.pixel_format
    if array_bytes(width, height, pixel_format) > MAX_FRAME_BYTES:
        raise PacketError(f"frame {header.frame_id}: an image of {_describe(header)} is refused")
    if header.encoding == Encoding.PNG:
        dtype = np.dtype(np.uint16 if pixel_format.in_words else np.uint8)
        try:
            image = png.decode(data, width, height, dtype, pixel_format.channels)
        except PacketError as error:
            raise PacketError(f"frame {header.frame_id}: {error}") from error
        image.flags.writeable = False
        return image
    expected = pixels_bytes(width, height, pixel_format)
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
    image = unpack_pixels(raw, width, height, pixel_format)
    image.flags.writeable = False
    return image


def chunks(frame_id: int, data: bytes, chunk_bytes: int) -> Iterator[FrameChunk]:
    """Yield the image's bytes cut into chunks."""
    for index, offset in enumerate(range(0, len(data), chunk_bytes)):
        yield FrameChunk(frame_id, index, offset, data[offset : offset + chunk_bytes])


def chunk_count(total_bytes: int, chunk_bytes: int) -> int:
    """Return the number of chunks that ``chunks`` yields.

    Returns
    -------
    int
        Number of chunks; 0 if there are no bytes.
    """
    return -(-total_bytes // chunk_bytes)


class FrameAssembler:
    """Assembler of frames from headers and chunks, which also reports lost frames.

    ``chunk`` returns completed frames, ``lost`` the numbers of those that cannot be completed.

    Parameters
    ----------
    terms : HelloAck, optional
        Terms of the handshake; other frames are refused before memory is allocated. None accepts any frame within
        ``MAX_FRAME_BYTES``.
    """

    def __init__(self, terms: Optional[HelloAck] = None) -> None:
        self._terms = terms
        self._header: Optional[FrameHeader] = None
        self._data = bytearray()
        self._received = bytearray()  # one flag per received chunk
        self._missing = 0  # number of chunks still missing
        self._chunk_bytes = 0  # size of all chunks but the last; 0 before the first
        self._last_lost_id: Optional[int] = None
        self._last_complete_id: Optional[int] = None
        self._lost_ids: List[int] = []

    @property
    def frame_id(self) -> Optional[int]:
        """Frame in progress."""
        return self._header.frame_id if self._header else None

    def header(self, header: FrameHeader) -> None:
        """Start a new frame; an incomplete one is lost. A repeated header changes nothing."""
        if header == self._header or header.frame_id == self._last_complete_id:
            return
        self.abandon()
        self._last_lost_id = header.frame_id  # the exception reports a refused header; its chunks are ignored
        self._check(header)
        self._last_lost_id = None
        self._header = header
        self._data = bytearray(header.total_bytes)
        self._received = bytearray(header.chunk_count)
        self._missing, self._chunk_bytes = header.chunk_count, 0

    def chunk(self, chunk: FrameChunk) -> Optional[Tuple[FrameHeader, Image]]:
        """Add a chunk, and return the frame if it is complete.

        Returns
        -------
        tuple of FrameHeader and array, or None
            Header and read-only image, (H, W) or (H, W, 3); None if the frame is not complete yet, was complete before,
            or is another one than that of the last header.

        Raises
        ------
        ProtocolMistake
            If the chunk is not at the offset that its index implies, or has another length than the others. The frame
            is abandoned.
        PacketError
            If the frame is complete but not an image.
        """
        header = self._header
        if chunk.frame_id == self._last_complete_id:
            return None  # received twice
        if header is None or chunk.frame_id != header.frame_id:
            self._lose(chunk.frame_id)  # its header was lost
            return None
        if not self._fits(chunk, header):
            # the exception reports it; the rest of this frame is ignored
            self._last_lost_id, self._header, self._data = header.frame_id, None, bytearray()
            raise ProtocolMistake(
                f"frame {header.frame_id}: chunk {chunk.index} of {header.chunk_count} has {len(chunk.data)} bytes at"
                f" {chunk.offset}, with which the chunks do not cover {header.total_bytes} bytes",
                header.frame_id,
            )
        self._data[chunk.offset : chunk.offset + len(chunk.data)] = chunk.data
        if not self._received[chunk.index]:
            self._received[chunk.index] = 1
            self._missing -= 1
        if self._missing:
            return None
        data, self._header, self._data = self._data, None, bytearray()
        try:
            image = decode_image(data, header)
        except PacketError:
            self._lose(header.frame_id)
            raise
        self._last_complete_id = header.frame_id
        return header, image

    def _fits(self, chunk: FrameChunk, header: FrameHeader) -> bool:
        last = header.chunk_count - 1
        if chunk.index > last:
            return False
        if not self._chunk_bytes:
            # only the last chunk may be shorter; its offset gives the length of the others
            at_end = chunk.offset // last if last else header.total_bytes
            self._chunk_bytes = len(chunk.data) if chunk.index < last else at_end
        size = self._chunk_bytes
        start = chunk.index * size
        # with a wrong length of the others, the last chunk would be empty or too long
        last_bytes = header.total_bytes - last * size
        return (
            0 < last_bytes <= size
            and chunk.offset == start
            and len(chunk.data) == (size if chunk.index < last else last_bytes)
        )

    def abandon(self) -> None:
        """Abandon the frame in progress because a part of it was damaged."""
        if self._header is not None:
            self._lose(self._header.frame_id)
            self._header, self._data = None, bytearray()

    @property
    def has_lost(self) -> bool:
        """True if ``lost`` has frames to return."""
        return bool(self._lost_ids)

    def lost(self) -> List[int]:
        """Return the frames lost since the last call, each once.

        Returns
        -------
        list of int
            Frame ids in the order in which the losses were noticed; empty if there are none.
        """
        lost_ids, self._lost_ids = self._lost_ids, []
        return lost_ids

    def _check(self, header: FrameHeader) -> None:
        if self._terms is not None:
            check_header(header, self._terms)
        elif not 0 < header.total_bytes <= MAX_FRAME_BYTES:
            raise PacketError(f"frame {header.frame_id}: a frame of {header.total_bytes} bytes is refused")
        # each chunk has at least one byte
        if not 0 < header.chunk_count <= header.total_bytes:
            raise ProtocolMistake(
                f"frame {header.frame_id} announces {header.chunk_count} chunks for {header.total_bytes} bytes",
                header.frame_id,
            )

    def _lose(self, frame_id: int) -> None:
        # called for every chunk of a frame without a header: report the frame once
        if frame_id != self._last_lost_id:
            self._last_lost_id = frame_id
            self._lost_ids.append(frame_id)
