"""Work on a picture's rows by two threads at once, piece by piece: the driver's threads rest by then.

Worth it for a few long calls that leave Python's lock alone. The result must not depend on where the rows are cut.
"""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def pieces_of(rows: int, count: int) -> list[tuple[int, int]]:
    """First row and end of ``count`` pieces, at most, of about one size."""
    count = max(min(count, rows), 1)
    return [(rows * k // count, rows * (k + 1) // count) for k in range(count)]


def share_out(pieces: list[tuple[int, int]], work: Callable[[int, int], None]) -> None:
    """Call ``work(first, end)`` for every piece, here and on another thread.

    Each takes the next piece that is left. The other one may be late, as another thread's work (the noise) holds its
    processor: then nothing waits for it.
    """
    left = deque(pieces)

    def take() -> None:
        while left:
            try:
                first, end = left.popleft()
            except IndexError:  # the other thread was quicker
                return
            work(first, end)

    if len(pieces) < 2:
        take()
        return
    other = _thread(os.getpid()).submit(take)
    take()
    if not other.cancel():
        other.result()


@lru_cache(maxsize=1)
def _thread(_process: int) -> ThreadPoolExecutor:
    """One thread that waits for work. A forked process needs its own."""
    return ThreadPoolExecutor(1, thread_name_prefix="flyaround-rows")
