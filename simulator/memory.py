"""How this process gives memory back: a renderer frees and asks for the same tens of megabytes with every frame."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h of the GNU C library
KEPT_BYTES = 256 << 20
LARGEST_KEPT_BYTES = 32 << 20  # the most that the library takes


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
