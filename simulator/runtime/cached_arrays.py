"""Arrays in the user's cache folder: decoded maps and tables that are slow to compute, written atomically.

Names and checksums are those of `runtime.cache`. A thread or program that needs an entry which another one is making
waits for it. Storing a new entry removes the least recently used ones (`runtime.cache_contents`).
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

_MAX_WAIT_S = 120.0  # for another maker of the same entry, which may have been stopped
_MAX_HEADER_BYTES = 1 << 16  # bytes of the header of NumPy's format 1.0
_T = TypeVar("_T", bound=np.generic)
_Array = np.typing.NDArray[np.generic]
_mapped_paths: dict[int, Path] = {}  # path of each mapped array, by identity
log = logging.getLogger(__name__)


def cached_array(key: str, make: Callable[[], NDArray[_T]]) -> NDArray[_T]:
    """Return the array stored under ``key``; if missing or damaged, take the prebuilt one or make it, and store it.

    Parameters
    ----------
    key : str
        File name without suffix; it must change whenever the output of ``make`` would.
    make : callable
        Makes the array.

    Returns
    -------
    array
        Stored or new array.
    """
    return cached_arrays((key,), lambda: (make(),))[0]


def cached_arrays(keys: Sequence[str], make: Callable[[], Sequence[NDArray[_T]]]) -> list[NDArray[_T]]:
    """Return several arrays, as `cached_array` does, that are made together.

    Returns
    -------
    list of array
        Arrays in the order of ``keys``, read-only where they are mapped from the cache. If one is missing or damaged,
        all are taken from those that are shipped, or made again.
    """
    paths = [cache_folder() / f"{key}.npy" for key in keys]
    arrays: list[NDArray[_T]] | None = _read(paths, logging.DEBUG)
    if arrays is not None:
        return arrays
    with ExitStack() as locks:
        with suppress(OSError):  # without a lock two makers write the same bytes
            paths[0].parent.mkdir(parents=True, exist_ok=True)
            locks.enter_context(locked_file(paths[0].with_suffix(".lock"), _MAX_WAIT_S))
        arrays = _read(paths, logging.WARNING)
        if arrays is not None:
            return arrays
        prebuilt: list[NDArray[_T]] | None = _read_prebuilt(keys)
        new_arrays = list(make()) if prebuilt is None else prebuilt
        return [_store_entry(*pair) for pair in zip(paths, new_arrays, strict=True)]


def entry_of(array: _Array) -> str | None:
    """Return the key of an array that came from the cache.

    Returns
    -------
    str or None
        Key; None for an array that is not mapped from the cache, such as a copy or slice of one that is.
    """
    path = _mapped_paths.get(id(array))
    return None if path is None else path.stem


def is_cached(key: str) -> bool:
    """Return True if `cached_array` would find a file, stored or prebuilt; it may be damaged."""
    path = cache_folder() / f"{key}.npy"
    return path.is_file() or is_prebuilt(path.name)


def _read_prebuilt(keys: Sequence[str]) -> list[NDArray[_T]] | None:
    arrays = [prebuilt_array(key) for key in keys]
    return None if any(array is None for array in arrays) else cast("list[NDArray[_T]]", arrays)


def _read(paths: Sequence[Path], level: int) -> list[NDArray[_T]] | None:
    try:
        arrays: list[NDArray[_T]] = [_map_entry(path) for path in paths]
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.log(level, "cache file %s or one with it cannot be read (%s) and is made again", paths[0], error)
        return None
    for path in paths:
        mark_used(path)
    return arrays


def _map_entry(path: Path) -> NDArray[_T]:
    """Map the array of a cache file, so that the driver copies it straight from the page cache."""
    contents, length = map_checked(path)
    array: NDArray[_T] = _array_of(contents, length)
    _remember(path, array)
    return array


def _remember(path: Path, array: _Array) -> None:
    """Record the path of a mapped array for as long as the array lives."""
    _mapped_paths[id(array)] = path
    weakref.finalize(array, _mapped_paths.pop, id(array), None).atexit = False


def _array_of(contents: mmap.mmap, length: int) -> NDArray[_T]:
    """Return the array of NumPy's format without a copy, as an ndarray: slicing a memmap is slower."""
    head = io.BytesIO(contents[: min(length, _MAX_HEADER_BYTES)])
    try:
        version = np.lib.format.read_magic(head)
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(head)
    except Exception as error:  # NumPy passes on tokenize errors of a damaged header
        raise DamagedError(f"it holds no array: {error}") from error
    if version != (1, 0) or dtype.hasobject or head.tell() + dtype.itemsize * np.prod(shape) != length:
        raise DamagedError("it holds no array of numbers")
    return np.ndarray(shape, dtype, contents, head.tell(), order="F" if is_fortran else "C")


def _store_entry(path: Path, array: NDArray[_T]) -> NDArray[_T]:
    """Store an array and return it mapped from the cache, or itself if it cannot be stored."""
    if not store_checked(path, lambda file: np.save(file, array, allow_pickle=False)):
        return array
    try:
        trim_cache()
        # the mapping lets this process free its own copy
        return _map_entry(path)
    except (OSError, ValueError) as error:
        log.warning("cache file %s cannot be read (%s)", path, error)
    return array
