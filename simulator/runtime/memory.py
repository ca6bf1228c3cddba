"""What this process keeps in memory: what a renderer frees and asks for with every frame, what is made of a craft."""

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
LARGEST_KEPT_BYTES = 32 << 20  # the most that the library takes
_Owner = TypeVar("_Owner")
_Made = TypeVar("_Made")


def keep_freed_memory() -> bool:
    """Have the C library keep what is freed for what is asked for next, up to 256 MiB; says whether it can.

    It would return images to the system at once and get them back page by page: some 5 ms for the pages of one frame.
    For a program's start, not for a library's import: it is a matter of the whole process.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return False
    # one arena: threads of their own ones give strips of a map back to the system all the same
    wanted = (
        (_M_MMAP_THRESHOLD, LARGEST_KEPT_BYTES),
        (_M_TRIM_THRESHOLD, KEPT_BYTES),
        (_M_ARENA_MAX, 1),
    )
    return all(mallopt(*one) for one in wanted)


def cached_per_object(make: Callable[[_Owner], _Made]) -> Callable[[_Owner], _Made]:
    """Have a function of one object remember what it made of each for as long as that object lives, and no longer.

    For what is worked out of a spacecraft: a cache of its last arguments would hold dozens of them, with megabytes
    each, after everyone else had forgotten them. What ``make`` returns may not refer to the object.
    """
    made: WeakKeyDictionary[_Owner, _Made] = WeakKeyDictionary()

    @wraps(make)
    def kept(owner: _Owner) -> _Made:
        if owner not in made:
            made[owner] = make(owner)
        return made[owner]

    return kept
