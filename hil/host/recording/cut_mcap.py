"""Repair of interrupted MCAP files: an end after the last complete record makes them readable."""

from __future__ import annotations

import contextlib
import os
import struct
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from pathlib import Path

# Magic bytes, length of a record after its opcode, and the end of a file without a summary: DataEnd, Footer, magic
# (MCAP file format, version 0).
MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<Q")
END = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC


def repair_mcap(path: Path) -> None:
    """End a file after its last complete record that leaves room for the end. Files without records are unchanged.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("r+b") as file:
        for end in reversed(_ends_of_records(file)):
            with contextlib.suppress(OSError):
                os.truncate(path, end)
                file.seek(end)
                file.write(END)
                file.flush()
                os.fsync(file.fileno())
                return


def _ends_of_records(file: BinaryIO) -> list[int]:
    """Return the offset after each complete record of the data section."""
    from mcap.exceptions import McapError  # noqa: PLC0415 - optional dependency
    from mcap.records import Chunk, DataEnd, Footer  # noqa: PLC0415
    from mcap.stream_reader import StreamReader, breakup_chunk  # noqa: PLC0415

    ends = [len(MAGIC)]
    # the file may end within a record, or hold arbitrary bytes there
    with contextlib.suppress(McapError, struct.error, ValueError, KeyError, OverflowError, MemoryError):
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, DataEnd | Footer):
                break
            if isinstance(record, Chunk):
                breakup_chunk(record, validate_crc=True)
            end = file.tell()
            file.seek(ends[-1] + 1)
            # a chunk's length is written last
            if ends[-1] + HEAD.size + 1 + HEAD.unpack(file.read(HEAD.size))[0] != end:
                break
            file.seek(end)
            ends.append(end)
    return ends[1:]
