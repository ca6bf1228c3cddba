"""Arrays in the user's cache folder: decoded maps and tables that are slow to make, written atomically.

A name says what an entry was made from, its end if it is what was written (`flyaround.simulator.runtime.cache`). Who needs what
another thread or program is making waits for it. What no program has asked for in `KEPT_DAYS` goes when something new
is stored.
"""

from __future__ import annotations

import io
import logging
import sys
import time
import weakref
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeVar, cast

import numpy as np

from flyaround.simulator.runtime.cache import DamagedError, cache_folder, map_checked, store_checked
from flyaround.simulator.runtime.prebuilt import is_prebuilt, prebuilt_array

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    import mmap
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

KEPT_DAYS = 90
_DAY_S = 86400.0
_LONGEST_WAIT_S, _LOOK_AGAIN_S = 120.0, 0.02  # for another that makes the same; it may have been stopped
_LONGEST_HEAD = 1 << 16  # of an array of NumPy's format 1.0
_T = TypeVar("_T", bound=np.generic)
_Array = np.typing.NDArray[np.generic]
_kept_as: dict[int, Path] = {}  # where arrays lie, by their identity
log = logging.getLogger(__name__)


def cache_bytes() -> int:
    """Size of the cache folder [bytes]."""
    total = 0
    for path in cache_folder().rglob("*"):
        with suppress(OSError):  # another program may have removed it
            total += path.stat().st_size if path.is_file() else 0
    return total


def cached_array(key: str, make: Callable[[], NDArray[_T]]) -> NDArray[_T]:
    """The array stored under ``key``; shipped or made, and stored, when it is not there or cannot be read.

    Parameters
    ----------
    key : file name without suffix; it must change whenever ``make`` would give something else.
    """
    return cached_arrays((key,), lambda: (make(),))[0]


def cached_arrays(keys: Sequence[str], make: Callable[[], Sequence[NDArray[_T]]]) -> list[NDArray[_T]]:
    """`cached_array` of several that are made together."""
    paths = [cache_folder() / f"{key}.npy" for key in keys]
    kept: list[NDArray[_T]] | None = _read(paths, logging.DEBUG)
    if kept is not None:
        return kept
    with _alone(paths[0].with_suffix(".lock")):
        kept = _read(paths, logging.WARNING)
        if kept is not None:
            return kept
        shipped: list[NDArray[_T]] | None = _shipped(keys)
        made = list(make()) if shipped is None else shipped
        return [_stored(*pair) for pair in zip(paths, made, strict=True)]


def entry_of(array: _Array) -> str | None:
    """The key of an array that came from the cache."""
    path = _kept_as.get(id(array))
    return None if path is None else path.stem


def is_cached(key: str) -> bool:
    """Whether there is a file of `cached_array`, or one is shipped; it may be damaged yet."""
    path = cache_folder() / f"{key}.npy"
    return path.is_file() or is_prebuilt(path.name)


def _shipped(keys: Sequence[str]) -> list[NDArray[_T]] | None:
    arrays = [prebuilt_array(key) for key in keys]
    return None if any(array is None for array in arrays) else cast("list[NDArray[_T]]", arrays)


def _read(paths: Sequence[Path], level: int) -> list[NDArray[_T]] | None:
    try:
        kept: list[NDArray[_T]] = [_mapped(path) for path in paths]
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.log(level, "cache file %s or one with it cannot be read (%s) and is made again", paths[0], error)
        return None
    for path in paths:
        _mark_used(path)
    return kept


def _mapped(path: Path) -> NDArray[_T]:
    """The array of a cache file: mapped, not read, for the driver copies it straight from the page cache."""
    contents, length = map_checked(path)
    array: NDArray[_T] = _array_of(contents, length)
    _remember(path, array)
    return array


def _remember(path: Path, array: _Array) -> None:
    """Where an array lies in the cache, for as long as there is this array."""
    _kept_as[id(array)] = path
    weakref.finalize(array, _kept_as.pop, id(array), None).atexit = False


def _array_of(contents: mmap.mmap, length: int) -> NDArray[_T]:
    """An array of NumPy's format where it lies: one of memmap's own type takes ten times as long to cut."""
    head = io.BytesIO(contents[: min(length, _LONGEST_HEAD)])
    try:
        version = np.lib.format.read_magic(head)
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(head)
    except (
        Exception
    ) as error:  # of a text that is no header NumPy says what Python's own reader of texts does
        raise DamagedError(f"it holds no array: {error}") from error
    if version != (1, 0) or dtype.hasobject or head.tell() + dtype.itemsize * np.prod(shape) != length:
        raise DamagedError("it holds no array of numbers")
    return np.ndarray(shape, dtype, contents, head.tell(), order="F" if is_fortran else "C")


def _stored(path: Path, array: NDArray[_T]) -> NDArray[_T]:
    """The array as it is in the cache now, or itself where it cannot be kept."""
    if not store_checked(path, lambda file: np.save(file, array, allow_pickle=False)):
        return array
    try:
        _forget(path.parent)
        # the page cache serves it from here on, this process's own memory is free again
        return _mapped(path)
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be read (%s)", path, error)
    return array


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """While nobody else makes what a lock file stands for.

    The system frees the lock of a program that ends. Without locks, as on some network disks, two make the same bytes.
    """
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        file = path.open("ab", buffering=0)
    except OSError:  # `_stored` says so
        yield
        return
    with file:
        until = time.monotonic() + _LONGEST_WAIT_S
        while not _lock(file) and time.monotonic() < until:
            time.sleep(_LOOK_AGAIN_S)
        try:
            yield
        finally:
            with suppress(OSError):  # who waits has this file open still, and finds what was made
                path.unlink()


def _lock(file: IO[bytes]) -> bool:
    """Whether the file is this program's and thread's now; also where it cannot be locked at all."""
    if sys.platform == "win32":
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _mark_used(path: Path) -> None:
    # once a day: a folder that may not be written to does not matter
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _DAY_S:
            path.touch()


def _forget(folder: Path) -> None:
    """Remove what was not used for long, and what a program left that ended while it wrote."""
    for path in (*folder.glob("*.npy"), *folder.glob("*.tmp"), *folder.glob("*.lock")):
        with suppress(OSError):  # another program may have removed it
            if time.time() - path.stat().st_mtime > KEPT_DAYS * _DAY_S:
                path.unlink()
