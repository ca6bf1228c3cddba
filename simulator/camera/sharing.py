"""Work on a picture's rows by several threads at once, piece by piece: a software driver's threads rest by then.

Worth it for a few long calls that leave Python's lock alone. The result must not depend on where the rows are cut.
"""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

from simulator.threads import usable_processors

if TYPE_CHECKING:
    from collections.abc import Callable


MOST_THREADS = 6  # more of them wait for Python's lock


def pieces_of(rows: int, count: int) -> list[tuple[int, int]]:
    """First row and end of ``count`` pieces, at most, of about one size."""
    count = max(min(count, rows), 1)
    return [(rows * k // count, rows * (k + 1) // count) for k in range(count)]


def share_out(pieces: list[tuple[int, int]], work: Callable[[int, int], None]) -> None:
    """Call ``work(first, end)`` for every piece, here and on other threads.

    Each takes the next piece that is left. Another one may be late, as another thread's work (the noise) holds its
    processor: then nothing waits for it.
    """
    left = deque(pieces)

    def take() -> None:
        while left:
            try:
                first, end = left.popleft()
            except IndexError:  # another thread was quicker
                return
            work(first, end)

    if len(pieces) < 2:
        take()
        return
    others = [_pool(os.getpid()).submit(take) for _ in range(min(threads(), len(pieces)) - 1)]
    take()
    for other in others:
        if not other.cancel():
            other.result()


@lru_cache(maxsize=1)
def threads() -> int:
    """How many share the work, this one too: two on the smallest machines, which a software driver has to itself."""
    return min(max(usable_processors(), 2), MOST_THREADS)


@lru_cache(maxsize=1)
def _pool(_process: int) -> ThreadPoolExecutor:
    """Threads that wait for work. A forked process needs its own."""
    return ThreadPoolExecutor(threads() - 1, thread_name_prefix="flyaround-rows")
