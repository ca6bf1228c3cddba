"""The user's cache folder: decoded maps and tables that are slow to make, written atomically.

A file's name says what it was made from; two programs that make the same at once write the same bytes, and the
later one stays. What no program has asked for in `KEPT_DAYS` goes when something new is stored.
"""

from __future__ import annotations

import logging
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import platformdirs

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

KEPT_DAYS = 90
_DAY_S = 86400.0
_T = TypeVar("_T", bound=np.generic)
log = logging.getLogger(__name__)


def cache_folder() -> Path:
    """``FLYAROUND_CACHE_DIR``, or the platform's cache folder for Flyaround."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR", "")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("flyaround"))


def cache_bytes() -> int:
    """What lies in the cache folder."""
    total = 0
    for path in cache_folder().rglob("*"):
        with suppress(OSError):  # another program may have removed it
            total += path.stat().st_size if path.is_file() else 0
    return total


def cached_array(key: str, make: Callable[[], NDArray[_T]]) -> NDArray[_T]:
    """The array stored under ``key``, made and stored when it is not there or cannot be read.

    Parameters
    ----------
    key : file name without suffix; it must change whenever ``make`` would give something else.
    """
    path = cache_folder() / f"{key}.npy"
    try:
        # mapped, not read: the driver copies it straight from the page cache
        kept = np.load(path, mmap_mode="r", allow_pickle=False)
        _mark_used(path)
        return kept
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be read (%s) and is made again", path, error)
    array = make()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            np.save(file, array)
        Path(file.name).replace(path)
        _forget(path.parent)
        # the page cache serves it from here on, this process's own memory is free again
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as error:
        # a full or read-only disk costs time at every start, not the picture
        log.warning("cannot keep %s in the cache (%s)", path, error)
    return array


def _mark_used(path: Path) -> None:
    # once a day: a folder that may not be written to does not matter
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _DAY_S:
            path.touch()


def _forget(folder: Path) -> None:
    """Remove what was not used for long, and what a program left that ended while it wrote."""
    for path in (*folder.glob("*.npy"), *folder.glob("*.tmp")):
        with suppress(OSError):  # another program may have removed it
            if time.time() - path.stat().st_mtime > KEPT_DAYS * _DAY_S:
                path.unlink()
