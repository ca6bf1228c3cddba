"""Arrays in the user's cache folder: decoded maps and tables that are slow to make, written atomically.

A name says what an entry was made from, its end if it is what was written (`simulator.runtime.cache`). Who needs what
another thread or program is making waits for it. What no program has asked for in `KEPT_DAYS` goes when something new
is stored. What a first picture is drawn from is written after it (`DeferredWrites`).
"""

from __future__ import annotations

import io
import logging
import sys
import threading
import time
import weakref
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeVar, cast

import numpy as np

from simulator.runtime.cache import DamagedError, cache_folder, map_checked, store_checked
from simulator.runtime.prebuilt import is_prebuilt, prebuilt_array

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    import mmap
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

KEPT_DAYS = 90
_DAY_S = 86400.0
_LONGEST_WAIT_S, _LOOK_AGAIN_S = 120.0, 0.02  # for another that makes the same; it may have been stopped
_LONGEST_DELAY_S, _LOOK_FOR_END_S = 20.0, 0.1  # of writing: a program may never draw, or end first
_LONGEST_HEAD = 1 << 16  # of an array of NumPy's format 1.0
_T = TypeVar("_T", bound=np.generic)
_Array = np.typing.NDArray[np.generic]
_unwritten: dict[Path, _Array] = {}  # what this program has made and will write
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
    with ExitStack() as alone:
        alone.enter_context(_alone(_lock_of(*paths), lambda: paths[0] in _unwritten))
        kept = _read(paths, logging.WARNING)
        if kept is not None:
            return kept
        shipped: list[NDArray[_T]] | None = _shipped(keys)
        made, later = list(make()) if shipped is None else shipped, _deferred.get()
        if later is None:
            return [_stored(*pair) for pair in zip(paths, made, strict=True)]
        later.write(dict(zip(paths, made, strict=True)), alone.pop_all())
        for path, array in zip(paths, made, strict=True):
            _remember(path, array)
        return made


class DeferredWrites:
    """Arrays of a first frame, written when it is drawn, or as soon as another program waits for one of them."""

    def __init__(self) -> None:
        self._start, self._changing = threading.Event(), threading.Lock()
        self._waiting: list[tuple[Mapping[Path, _Array], ExitStack]] = []

    def use(self) -> None:
        """Defer what this thread makes from here on."""
        _deferred.set(self)

    def start(self) -> None:
        """Begin to write, on a thread; what is made from here on is written at once."""
        self._start.set()

    def write(self, made: Mapping[Path, _Array], alone: ExitStack) -> None:
        """Write arrays when it is time; others are let at them then, by closing ``alone``."""
        _unwritten.update(made)
        with self._changing:
            waits = not self._start.is_set()
            if waits and not self._waiting:
                threading.Thread(target=self._write_all).start()
            if waits:
                self._waiting.append((made, alone))
        if not waits:
            _write(made, alone)

    def _write_all(self) -> None:
        until = time.monotonic() + _LONGEST_DELAY_S
        while not self._start.wait(_LOOK_FOR_END_S):
            # two programs may each have made what the other needs
            wanted = any(_is_wanted(_lock_of(*made)) for made, _ in list(self._waiting))
            if wanted or time.monotonic() > until or not threading.main_thread().is_alive():
                break
        with self._changing:
            self._start.set()
            waiting, self._waiting = self._waiting, []
        while waiting:  # each is forgotten before the next
            _write(*waiting.pop(0))


_deferred: ContextVar[DeferredWrites | None] = ContextVar("_deferred", default=None)


def entry_of(array: _Array) -> str | None:
    """The key of an array that came from the cache or will be written to it."""
    path = _kept_as.get(id(array))
    return None if path is None else path.stem


def _write(made: Mapping[Path, _Array], alone: ExitStack) -> None:
    try:
        with alone:
            for path, array in made.items():
                _stored(path, array)
    finally:
        for path in made:
            _unwritten.pop(path, None)


def is_cached(key: str) -> bool:
    """Whether there is a file of `cached_array`, or will be, or one is shipped; it may be damaged yet."""
    path = cache_folder() / f"{key}.npy"
    return path in _unwritten or path.is_file() or is_prebuilt(path.name)


def _shipped(keys: Sequence[str]) -> list[NDArray[_T]] | None:
    arrays = [prebuilt_array(key) for key in keys]
    return None if any(array is None for array in arrays) else cast("list[NDArray[_T]]", arrays)


def _read(paths: Sequence[Path], level: int) -> list[NDArray[_T]] | None:
    here = [_unwritten.get(path) for path in paths]
    if all(array is not None for array in here):
        return cast("list[NDArray[_T]]", here)
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


def _lock_of(first: Path, *_: Path) -> Path:
    """The lock file of arrays that are made together."""
    return first.with_suffix(".lock")


def _is_wanted(lock: Path) -> bool:
    """Whether another program waits for a lock: it then has something written in it."""
    try:
        return lock.stat().st_size > 0
    except OSError:
        return False


@contextmanager
def _alone(path: Path, made_here: Callable[[], bool]) -> Iterator[None]:
    """While nobody else makes what a lock file stands for; or when this program has made it meanwhile.

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
        while not (mine := _lock(file)) and not made_here() and time.monotonic() < until:
            if file.tell() == 0:
                with suppress(OSError):  # a full disk: the other writes when its picture is drawn
                    file.write(b"wanted")
            time.sleep(_LOOK_AGAIN_S)
        try:
            yield
        finally:
            # who waits has this file open still, and finds what was made
            if mine or not made_here():
                with suppress(OSError):
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
