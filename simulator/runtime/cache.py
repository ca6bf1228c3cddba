"""The user's cache folder: names of its entries, and files with a trailing checksum.

The name of an entry contains its kind and a hash of its inputs and of the source code that makes it (`entry_name`).
Therefore output of older code is never read. Any edit of that source changes the name, even of a comment.

A file is its contents and a trailer of 40 bytes: `MAGIC`, the length of the contents and their 128-bit XXH3,
little-endian. Programs that read the contents alone (NumPy, glTF readers) ignore the trailer. The checksum detects
accidents; it does not protect against somebody who may write to the folder, and nothing from here is executed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import logging
import mmap
import os
import struct
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import platformdirs
import xxhash

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import IO

MAGIC = b"flyaround cache1"
_UNFINISHED_S = 86_400.0  # age of a temporary file whose writer must be gone
_TRAILER = struct.Struct("<16sQ16s")
log = logging.getLogger(__name__)


class DamagedError(ValueError):
    """A damaged cache file."""


def cache_folder(part: str = "") -> Path:
    """Return the cache folder, or a subfolder of it.

    Returns
    -------
    Path
        ``FLYAROUND_CACHE_DIR`` or the platform's cache folder, joined with ``part``; it may not exist yet.
    """
    folder = os.environ.get("FLYAROUND_CACHE_DIR", "")
    return (Path(folder) if folder else Path(platformdirs.user_cache_dir("flyaround"))) / part


def entry_name(name: str, makers: Sequence[Callable[..., object]], *inputs: object) -> str:
    """Return the file name of a cache entry, without suffix: ``name-HASH``.

    Parameters
    ----------
    name : str
        Kind of the entry.
    makers : sequence of callables
        The function that makes the entry, and one of each other module on which its output depends: the source code of
        their modules is hashed.
    *inputs : object
        Arguments of the maker: numbers, texts, bytes, arrays, dataclasses, and tuples or lists of these. Computed
        floats should be rounded, because processors differ in their last bits.

    Returns
    -------
    str
        Name with 20 hexadecimal digits.

    Raises
    ------
    TypeError
        If an input is of another type.
    """
    digest = hashlib.sha256()
    for maker in makers:
        digest.update(_source_digest(maker.__module__))
    for item in inputs:
        _hash_input(digest, item)
    return f"{name}-{digest.hexdigest()[:20]}"


@cache
def _source_digest(module: str) -> bytes:
    return hashlib.sha256(Path(sys.modules[module].__file__ or "").read_bytes()).digest()


def _hash_input(digest: hashlib._Hash, value: object) -> None:
    """Add a value to a hash with its type and length, so that no two input lists collide."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("an array of objects cannot name a cache entry")
        digest.update(f"array {value.dtype.str} {value.shape};".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, bytes):
        digest.update(f"bytes {len(value)};".encode() + value)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        _hash_input(digest, tuple(getattr(value, f.name) for f in dataclasses.fields(value)))
    elif isinstance(value, (tuple, list)):
        digest.update(f"list {len(value)};".encode())
        for one in value:
            _hash_input(digest, one)
    elif value is None or isinstance(value, (bool, int, float, str)):
        plain = float(value) if isinstance(value, float) else value  # NumPy's floats have another repr
        text = repr(plain).encode()
        digest.update(f"text {len(text)};".encode() + text)
    else:
        raise TypeError(f"a {type(value).__name__} cannot name a cache entry")


def map_checked(path: Path) -> tuple[mmap.mmap, int]:
    """Map a cache file for reading, verify it, and return it with the length of its contents.

    Raises
    ------
    DamagedError
        If the file is damaged.
    OSError
        If the file is missing or cannot be read.
    """
    with path.open("rb") as file:
        if os.fstat(file.fileno()).st_size < _TRAILER.size:
            raise DamagedError("it is cut short")
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    magic, length, digest = _TRAILER.unpack(mapped[-_TRAILER.size :])
    if magic != MAGIC or length != len(mapped) - _TRAILER.size:
        raise DamagedError("it is cut short, or from an older version")
    with memoryview(mapped) as view, view[:length] as contents:
        checksum = xxhash.xxh3_128_digest(contents)
    if checksum != digest:
        raise DamagedError("its checksum does not match")
    return mapped, length


def read_checked(path: Path) -> bytes | None:
    """Read the contents of a cache file, and log damage.

    Returns
    -------
    bytes or None
        Copy of the contents without the trailer; None if the file is missing or damaged.
    """
    try:
        mapped, length = map_checked(path)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be used (%s); it is computed again", path, error)
        return None
    mark_used(path)
    with mapped:
        return mapped[:length]


def mark_used(path: Path) -> None:
    """Set a cache file's time of last use, if the folder is writable."""
    with contextlib.suppress(OSError):
        path.touch(exist_ok=True)


def store_checked(path: Path, write: Callable[[IO[bytes]], object]) -> bool:
    """Write a file into the cache atomically: a reader sees the old file or the whole new one.

    Returns
    -------
    bool
        True if it was stored. A full, read-only or foreign disk only costs time at every start: it is logged, no error.
    """
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_temporary_files(path.parent)
        # in write-only mode NumPy writes without a copy, and releases Python's lock
        with tempfile.NamedTemporaryFile("wb", dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = Path(file.name)
            write(file.file)
            file.flush()
            file.write(_trailer(temporary))
        temporary.replace(path)
    except OSError as error:
        log.warning("cannot keep %s in the cache (%s)", path, error)
        if temporary is not None:
            with contextlib.suppress(OSError):  # a partly written file must not stay on a full disk
                temporary.unlink(missing_ok=True)
        return False
    return True


def _remove_temporary_files(folder: Path) -> None:
    """Remove temporary files of writers that were killed."""
    for path in folder.glob("*.tmp"):
        with contextlib.suppress(OSError):  # another program may have removed it
            if time.time() - path.stat().st_mtime > _UNFINISHED_S:
                path.unlink()


def _trailer(path: Path) -> bytes:
    """Read the trailer of a cache file."""
    with path.open("rb") as file:
        length = os.fstat(file.fileno()).st_size
        if not length:
            return _TRAILER.pack(MAGIC, 0, xxhash.xxh3_128_digest(b""))
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as contents:
            return _TRAILER.pack(MAGIC, length, xxhash.xxh3_128_digest(contents))
