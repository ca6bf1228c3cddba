"""Messages of an untrusted MCAP file, in the order of the file. The package mcap must be installed."""

from __future__ import annotations

import io
import struct
from dataclasses import replace
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mcap.records import Channel, Chunk, Message, Schema

MAX_CHUNK_BYTES = 1 << 30
"""Limit of a chunk, packed and unpacked; it holds one of our largest images at most."""


def mcap_messages(file: IO[bytes]) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """Yield schema, channel and message. No chunk is unpacked to more than the size that it declares.

    Raises
    ------
    ValueError
        If the file is damaged, or a chunk is larger than ``MAX_CHUNK_BYTES``.
    """
    from lz4.frame import LZ4FrameFile  # noqa: PLC0415 - comes with mcap
    from mcap.exceptions import McapError  # noqa: PLC0415 - optional
    from mcap.records import Channel, Chunk, Message, Schema  # noqa: PLC0415 - optional
    from mcap.stream_reader import StreamReader, breakup_chunk  # noqa: PLC0415 - optional
    from zstandard import ZstdDecompressor, ZstdError  # noqa: PLC0415 - comes with mcap

    def unpacked(chunk: Chunk) -> Chunk:
        readers = {"lz4": LZ4FrameFile, "zstd": ZstdDecompressor().stream_reader}
        if chunk.compression not in readers:
            return chunk
        size = chunk.uncompressed_size
        if size > MAX_CHUNK_BYTES:
            raise ValueError(f"a chunk of {size:,} bytes, at most {MAX_CHUNK_BYTES:,} are read")
        data = readers[chunk.compression](io.BytesIO(chunk.data)).read(size + 1)
        if len(data) != size:
            raise ValueError(f"a chunk does not hold {size:,} bytes")
        return replace(chunk, compression="", data=data)

    reader = StreamReader(file, validate_crcs=True, emit_chunks=True, record_size_limit=MAX_CHUNK_BYTES)
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    try:
        for outer in reader.records:
            inner = breakup_chunk(unpacked(outer), validate_crc=True) if isinstance(outer, Chunk) else [outer]
            for record in inner:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    yield schemas[channel.schema_id] if channel.schema_id else None, channel, record
    except KeyError as error:
        raise ValueError(f"a message refers to the channel or schema {error}, which is missing") from error
    # damaged chunks end in ZstdError or RuntimeError (lz4), damaged lengths in the others
    except (McapError, RuntimeError, EOFError, struct.error, ZstdError, OverflowError, MemoryError) as error:
        raise ValueError(str(error) or type(error).__name__) from error
