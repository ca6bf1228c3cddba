"""Threads: how many the libraries under this process use, and rows of a picture worked on by several."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

MOST_THREADS = 6  # more of them wait for Python's lock


def use_one_for_matrices() -> None:
    """Have NumPy's and SciPy's library of matrices use one thread, unless the user has chosen.

    The matrices here are small: more threads mostly wait, and spend on that what the driver and the decoders could use;
    each has tens of megabytes of its own. For a program's start, before NumPy is imported: the library looks then.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def usable_processors() -> int:
    """Those that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def beside_the_caller() -> int:
    """Threads that keep the processors busy which a caller that goes on working leaves free; at least one."""
    return max(usable_processors() - 1, 1)


def share_processors(processes: int) -> None:
    """Have a software driver in this process start its share of threads, unless the user has chosen.

    By default llvmpipe starts one for each processor, in each process: of two that draw at once, four threads get in
    each other's way, which costs up to a third of the frames (docs/validation/scaling.md). With no more than one
    processor to itself a process draws by its own thread alone. For a process's start: the driver looks when its
    context is made.

    Parameters
    ----------
    processes : that draw at once, this one too; of one alone nothing is changed.
    """
    if processes > 1:
        share = usable_processors() // processes
        os.environ.setdefault(
            "LP_NUM_THREADS", str(share if share > 1 or processes < usable_processors() else 0)
        )


def pieces_of(rows: int, count: int) -> list[tuple[int, int]]:
    """First row and end of ``count`` pieces, at most, of about one size."""
    count = max(min(count, rows), 1)
    return [(rows * k // count, rows * (k + 1) // count) for k in range(count)]


def share_out(pieces: list[tuple[int, int]], work: Callable[[int, int], None]) -> None:
    """Call ``work(first, end)`` for every piece, here and on other threads: a software driver's rest by then.

    Worth it for a few long calls that leave Python's lock alone. The result must not depend on where the rows are cut.
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
