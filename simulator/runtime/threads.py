"""Threads: number used by the libraries of this process, and image rows shared among several."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

MAX_THREADS = 6  # more threads wait for Python's lock


def use_one_for_matrices() -> None:
    """Limit NumPy's and SciPy's BLAS to one thread, unless the user has set its number.

    The matrices here are small: more threads would mostly spin, and each takes tens of megabytes. Call it at a
    program's start, before NumPy is imported and reads the setting.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def usable_processors() -> int:
    """Return the number of processors that this process may run on.

    Returns
    -------
    int
        Number of processors, at least 1; without affinity masks that of the machine.
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def helper_threads() -> int:
    """Return the number of threads that fill the processors beside a busy caller.

    Returns
    -------
    int
        One less than the usable processors, but at least 1.
    """
    return max(usable_processors() - 1, 1)


def share_processors(processes: int) -> None:
    """Limit a software driver in this process to its share of threads, unless the user has set their number.

    By default llvmpipe starts one thread per processor in each process, so that the threads of several processes
    compete (docs/validation/scaling.md). If a process gets at most one processor, the driver draws in the calling
    thread. Call this at the start of a process, because the driver reads the setting when its context is created.

    Parameters
    ----------
    processes : int
        Number of drawing processes, this one included; 1 changes nothing.
    """
    if processes > 1:
        share = usable_processors() // processes
        os.environ.setdefault(
            "LP_NUM_THREADS", str(share if share > 1 or processes < usable_processors() else 0)
        )


def split_rows(rows: int, count: int) -> list[tuple[int, int]]:
    """Divide rows into up to ``count`` pieces of about equal size.

    Returns
    -------
    list of tuple of int
        First and end row of each piece, in ascending order and without gaps: fewer than ``count`` pieces if there are
        fewer rows, and at least one.
    """
    count = max(min(count, rows), 1)
    return [(rows * k // count, rows * (k + 1) // count) for k in range(count)]


def run_in_threads(pieces: list[tuple[int, int]], work: Callable[[int, int], None]) -> None:
    """Call ``work(first, end)`` for every piece, in this thread and in helper threads.

    It pays for a few long calls that release Python's global lock. The result must not depend on the division into
    rows. Each thread takes the next remaining piece, so a thread that is delayed does not delay the others.
    """
    queue = deque(pieces)

    def take() -> None:
        while queue:
            try:
                first, end = queue.popleft()
            except IndexError:  # another thread was quicker
                return
            work(first, end)

    if len(pieces) < 2:
        take()
        return
    helpers = [_pool(os.getpid()).submit(take) for _ in range(min(threads(), len(pieces)) - 1)]
    take()
    for other in helpers:
        if not other.cancel():
            other.result()


@lru_cache(maxsize=1)
def threads() -> int:
    """Return the number of threads that share work.

    Returns
    -------
    int
        2 to `MAX_THREADS`, the calling thread included; 2 even on one processor.
    """
    return min(max(usable_processors(), 2), MAX_THREADS)


@lru_cache(maxsize=1)
def _pool(_process: int) -> ThreadPoolExecutor:
    """Return the pool of helper threads, one for each process: threads do not survive a fork."""
    return ThreadPoolExecutor(threads() - 1, thread_name_prefix="flyaround-rows")
