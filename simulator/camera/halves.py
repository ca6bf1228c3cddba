"""Work on a picture's rows by two threads at once, each with a half: the driver's threads rest by then.

Worth it for a few long calls that leave Python's lock alone. The result must not depend on where the rows are cut.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def in_halves(rows: int, work: Callable[[int, int], None], *, worth: bool) -> None:
    """Call ``work(first, end)`` for rows that add up to all.

    Parameters
    ----------
    worth : whether the work takes longer than to wake a thread, some 0.1 ms; else there is one call.
    """
    if not worth or rows < 2:
        work(0, rows)
        return
    upper = _thread(os.getpid()).submit(work, 0, rows // 2)
    work(rows // 2, rows)
    upper.result()


@lru_cache(maxsize=1)
def _thread(_process: int) -> ThreadPoolExecutor:
    """One thread that waits for work. A forked process needs its own."""
    return ThreadPoolExecutor(1, thread_name_prefix="flyaround-half")
