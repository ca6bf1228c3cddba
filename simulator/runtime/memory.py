"""Memory of this process: allocator settings for a renderer, and results cached for the lifetime of an object."""

from __future__ import annotations

import ctypes
import sys
from functools import wraps
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from collections.abc import Callable

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h of the GNU C library

# Size of free memory that the C library keeps for reuse [bytes].
RETAINED_BYTES = 256 << 20
MAX_RETAINED_BLOCK_BYTES = 32 << 20  # the largest value that the library accepts
_Owner = TypeVar("_Owner")
_Result = TypeVar("_Result")


def keep_freed_memory() -> bool:
    """Let the C library retain up to 256 MiB of freed memory for reuse.

    By default it returns the memory of images to the system at once, and page faults slow down every frame. The setting
    is process-wide, so programs call this at their start, and importing the library does not.

    Returns
    -------
    bool
        True if the C library accepted the settings; False on systems other than Linux, and without ``mallopt``.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return False
    # one arena: threads with their own would still return strips of a map to the system
    settings = (
        (_M_MMAP_THRESHOLD, MAX_RETAINED_BLOCK_BYTES),
        (_M_TRIM_THRESHOLD, RETAINED_BYTES),
        (_M_ARENA_MAX, 1),
    )
    return all(mallopt(*setting) for setting in settings)


def cached_per_object(make: Callable[[_Owner], _Result]) -> Callable[[_Owner], _Result]:
    """Cache the result of a function of one object for the lifetime of that object.

    It serves data derived from a target; an `lru_cache` would keep many targets alive. The result of ``make`` must not
    refer to the object.

    Returns
    -------
    callable
        Function that calls ``make`` at the first call for an object, and then returns the same result until the object
        is collected.
    """
    results: WeakKeyDictionary[_Owner, _Result] = WeakKeyDictionary()

    @wraps(make)
    def cached(owner: _Owner) -> _Result:
        if owner not in results:
            results[owner] = make(owner)
        return results[owner]

    return cached
