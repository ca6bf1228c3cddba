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
KEPT_BYTES = 256 << 20
LARGEST_KEPT_BYTES = 32 << 20  # the largest value that the library accepts
_Owner = TypeVar("_Owner")
_Made = TypeVar("_Made")


def keep_freed_memory() -> bool:
    """Have the C library keep up to 256 MiB of freed memory for reuse; return True if it can.

    By default it returns images to the system at once and faults them in again page by page: some 5 ms per frame. The
    setting is process-wide, so a program calls it at its start; importing the library does not.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return False
    # one arena: threads with their own would still return strips of a map to the system
    settings = (
        (_M_MMAP_THRESHOLD, LARGEST_KEPT_BYTES),
        (_M_TRIM_THRESHOLD, KEPT_BYTES),
        (_M_ARENA_MAX, 1),
    )
    return all(mallopt(*one) for one in settings)


def cached_per_object(make: Callable[[_Owner], _Made]) -> Callable[[_Owner], _Made]:
    """Make a function of one object remember its result for as long as that object lives.

    Meant for data derived from a spacecraft: an `lru_cache` would keep dozens of them alive, with megabytes each. The
    result of ``make`` may not refer to the object.
    """
    results: WeakKeyDictionary[_Owner, _Made] = WeakKeyDictionary()

    @wraps(make)
    def kept(owner: _Owner) -> _Made:
        if owner not in results:
            results[owner] = make(owner)
        return results[owner]

    return kept
