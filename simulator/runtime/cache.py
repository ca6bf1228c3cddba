"""The user's cache folder, how its entries are named, and its files, each with a checksum behind its contents.

An entry is named by what it is and a hash of its inputs and of the source code that makes it (`entry_name`), so that
nothing is read that older code has made. Any edit of that source counts, be it a comment.

A file is its contents and 40 bytes more: `MAGIC`, the length of the contents and their XXH3 of 128 bits,
little-endian. Programs that read the contents alone (NumPy, readers of glTF) do not mind what follows. The checksum
tells of accidents; it is no defence against who may write to the folder, and nothing that is read from here is run.
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
_UNFINISHED_S = 86_400.0  # nobody writes one file for longer
_TRAILER = struct.Struct("<16sQ16s")
log = logging.getLogger(__name__)


class DamagedError(ValueError):
    """A cache file that is not what was written."""


def cache_folder(part: str = "") -> Path:
    """``FLYAROUND_CACHE_DIR``, or the platform's cache folder for Flyaround; or a part of it by its name."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR", "")
    return (Path(chosen) if chosen else Path(platformdirs.user_cache_dir("flyaround"))) / part


def entry_name(name: str, makers: Sequence[Callable[..., object]], *inputs: object) -> str:
    """Return the file name of a cache entry, without suffix: ``name-HASH``.

    Parameters
    ----------
    name : str
        Kind of the entry.
    makers : sequence of callables
        The function that makes the entry, and one of each other module on which its output depends: the source code of
        their modules is hashed.
    *inputs : numbers, texts, bytes, arrays, dataclasses, and tuples or lists of them
        Arguments of the maker. Floats that are computed should be rounded: processors differ in their last bits.

    Raises
    ------
    TypeError
        If an input is of another type.
    """
    digest = hashlib.sha256()
    for maker in makers:
        digest.update(_source_digest(maker.__module__))
    for one in inputs:
        _hash_input(digest, one)
    return f"{name}-{digest.hexdigest()[:20]}"


@cache
def _source_digest(module: str) -> bytes:
    return hashlib.sha256(Path(sys.modules[module].__file__ or "").read_bytes()).digest()


def _hash_input(digest: hashlib._Hash, value: object) -> None:
    """Add a value to a hash, with its kind and length, so that no two lists of inputs read alike."""
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
        plain = (
            float(value) if isinstance(value, float) else value
        )  # NumPy's floats write themselves otherwise
        text = repr(plain).encode()
        digest.update(f"text {len(text)};".encode() + text)
    else:
        raise TypeError(f"a {type(value).__name__} cannot name a cache entry")


def map_checked(path: Path) -> tuple[mmap.mmap, int]:
    """A cache file mapped for reading, found to be what was written, and the length of its contents.

    Raises
    ------
    DamagedError
        If it is not. OSError : if there is no such file, or it cannot be read.
    """
    with path.open("rb") as file:
        if os.fstat(file.fileno()).st_size < _TRAILER.size:
            raise DamagedError("it is cut short")
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    magic, length, digest = _TRAILER.unpack(mapped[-_TRAILER.size :])
    if magic != MAGIC or length != len(mapped) - _TRAILER.size:
        raise DamagedError("it is cut short, or of an older version")
    with memoryview(mapped) as whole, whole[:length] as contents:
        found = xxhash.xxh3_128_digest(contents)
    if found != digest:
        raise DamagedError("its checksum is another")
    return mapped, length


def read_checked(path: Path) -> bytes | None:
    """The contents of a cache file; ``None`` where there is none, or it is damaged, which is logged."""
    try:
        mapped, length = map_checked(path)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be used (%s) and is made again", path, error)
        return None
    mark_used(path)
    with mapped:
        return mapped[:length]


def mark_used(path: Path) -> None:
    """Set a cache file's time of last use; a folder that may not be written to does not matter."""
    with contextlib.suppress(OSError):
        path.touch(exist_ok=True)


def store_checked(path: Path, write: Callable[[IO[bytes]], object]) -> bool:
    """Keep in the cache what ``write`` writes to a file; a reader sees the old file or the whole new one.

    Returns
    -------
    Whether it is kept. A disk that is full, read-only or another's costs time at every start: it is logged, no error.
    """
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _forget_unfinished(path.parent)
        # open for writing alone numpy writes it as it lies, and leaves Python free meanwhile
        with tempfile.NamedTemporaryFile("wb", dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = Path(file.name)
            write(file.file)
            file.flush()
            file.write(_trailer(temporary))
        temporary.replace(path)
    except OSError as error:
        log.warning("cannot keep %s in the cache (%s)", path, error)
        if temporary is not None:
            with contextlib.suppress(OSError):  # half a file would fill a full disk for good
                temporary.unlink(missing_ok=True)
        return False
    return True


def _forget_unfinished(folder: Path) -> None:
    """Remove what programs left that were ended while they wrote."""
    for path in folder.glob("*.tmp"):
        with contextlib.suppress(OSError):  # another program may have removed it
            if time.time() - path.stat().st_mtime > _UNFINISHED_S:
                path.unlink()


def _trailer(path: Path) -> bytes:
    """What is written behind the contents of a file."""
    with path.open("rb") as file:
        length = os.fstat(file.fileno()).st_size
        if not length:
            return _TRAILER.pack(MAGIC, 0, xxhash.xxh3_128_digest(b""))
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as contents:
            return _TRAILER.pack(MAGIC, length, xxhash.xxh3_128_digest(contents))
