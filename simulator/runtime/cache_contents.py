"""The contents of the cache folder: kinds of entries, their sizes, and removal."""

from __future__ import annotations

import os
import re
import time
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.cache import cache_folder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SIZE_VARIABLE = "FLYAROUND_CACHE_MB"

# Default limit of the cache [MB].
DEFAULT_MB = 300

FOLDERS = ("board-models", "shaders", "boards")
"""Subfolders that this project writes to; others in the folder are not its own."""

SUFFIXES = (".npy", ".tmp", ".lock")
RECENT_USE_S = 600.0  # entries used so recently may belong to a running program

# Time after which an unused entry is removed [s].
MAX_UNUSED_S = 90 * 86_400.0


@dataclass(frozen=True)
class CacheKind:
    """The entries of one kind.

    Parameters
    ----------
    name : str
        Kind, as file names begin with it.
    files : int
        Number of entries.
    size_bytes : int
        Their size.
    """

    name: str
    files: int
    size_bytes: int


def max_cache_bytes() -> int:
    """Return the size limit of the cache, from ``FLYAROUND_CACHE_MB`` if set.

    Returns
    -------
    int
        Limit [bytes], a multiple of 1,000,000.

    Raises
    ------
    UserError
        If the variable is not a number of megabytes.
    """
    text = os.environ.get(SIZE_VARIABLE, "") or str(DEFAULT_MB)
    if not re.fullmatch(r"\d{1,9}", text):
        raise UserError(
            f"{SIZE_VARIABLE} is {text!r}: give a whole number of megabytes, such as {DEFAULT_MB}"
        )
    return int(text) * 1_000_000


def cache_kinds() -> list[CacheKind]:
    """Return the kinds of entries in the cache folder.

    Returns
    -------
    list of CacheKind
        Kinds by total size, largest first; empty without entries. Files of a subfolder are one kind, named after it.
    """
    files: dict[str, int] = defaultdict(int)
    sizes: dict[str, int] = defaultdict(int)
    for path, stat in _files():
        inside = path.relative_to(cache_folder()).parts
        kind = inside[0] if len(inside) > 1 else re.split(r"-[0-9a-f]{20}", path.stem)[0]
        files[kind] += 1
        sizes[kind] += stat.st_size
    return sorted((CacheKind(k, files[k], sizes[k]) for k in files), key=lambda kind: -kind.size_bytes)


def clear_cache() -> int:
    """Remove every entry of the cache.

    Returns
    -------
    int
        Size of the removed files [bytes].

    Raises
    ------
    UserError
        If a file cannot be removed.
    """
    freed_bytes = 0
    for path, stat in list(_files()):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise UserError(f"{path} cannot be removed ({error.strerror}): remove it by hand") from error
        freed_bytes += stat.st_size
    return freed_bytes


def trim_cache() -> None:
    """Remove entries unused for `MAX_UNUSED_S`, then the least recently used ones until the cache is below its limit.

    Entries used within `RECENT_USE_S` stay regardless: a run would otherwise make its own again and again.
    """
    files = sorted(_files(), key=lambda pair: pair[1].st_mtime)
    total = sum(stat.st_size for _, stat in files)
    limit_bytes, now = max_cache_bytes(), time.time()
    for path, stat in files:
        unused_s = now - stat.st_mtime
        if unused_s > MAX_UNUSED_S or (total > limit_bytes and unused_s > RECENT_USE_S):
            with suppress(OSError):  # another program may have removed it
                path.unlink()
                total -= stat.st_size


def _files() -> Iterator[tuple[Path, os.stat_result]]:
    """Yield the cache's own files and their `os.stat_result`."""
    folder = cache_folder()
    places = (*folder.glob("*"), *(path for name in FOLDERS for path in (folder / name).rglob("*")))
    for path in places:
        if path.parent == folder and path.suffix not in SUFFIXES:
            continue
        with suppress(OSError):  # another program may have removed it
            stat = path.lstat()
            if path.is_file() and not path.is_symlink():
                yield path, stat
