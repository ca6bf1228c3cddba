"""Arrays in the user's cache folder: decoded maps and tables that are slow to make, written atomically.

A name says what an entry was made from, its end if it is what was written (`runtime.cache`). Who needs
what another thread or program is making waits for it. When something new is stored the least recently used entries
go (`runtime.cache_contents`).
"""

from __future__ import annotations

import io
import logging
import weakref
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np

from flyaround.simulator.runtime.cache import (
    DamagedError,
    cache_folder,
    map_checked,
    mark_used,
    store_checked,
)
from flyaround.simulator.runtime.cache_contents import trim_cache
from flyaround.simulator.runtime.folder_lock import locked_file
from flyaround.simulator.runtime.prebuilt import is_prebuilt, prebuilt_array

if TYPE_CHECKING:
    import mmap
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

_LONGEST_WAIT_S = 120.0  # for another that makes the same; it may have been stopped
_LONGEST_HEAD = 1 << 16  # of an array of NumPy's format 1.0
_T = TypeVar("_T", bound=np.generic)
_Array = np.typing.NDArray[np.generic]
_kept_as: dict[int, Path] = {}  # where arrays lie, by their identity
log = logging.getLogger(__name__)


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
    with ExitStack() as held:
        with suppress(OSError):  # without a lock two make the same bytes
            paths[0].parent.mkdir(parents=True, exist_ok=True)
            held.enter_context(locked_file(paths[0].with_suffix(".lock"), _LONGEST_WAIT_S))
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
        mark_used(path)
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
        trim_cache()
        # the page cache serves it from here on, this process's own memory is free again
        return _mapped(path)
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be read (%s)", path, error)
    return array
