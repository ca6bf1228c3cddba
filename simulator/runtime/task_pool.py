"""Independent tasks in several processes; results in the order of the tasks."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import TYPE_CHECKING, TypeVar

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.worker import leave_with_parent

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

A = TypeVar("A")
B = TypeVar("B")


def run_tasks(
    work: Callable[[A], B],
    tasks: Sequence[A],
    workers: int,
    *,
    start: Callable[..., object] | None = None,
    arguments: tuple[object, ...] = (),
    chunk_size: int = 1,
) -> Generator[B]:
    """Yield ``work(task)`` in order, each computed in one of ``workers`` processes.

    A single worker is also a separate process. Processes are terminated when the generator is closed or the parent
    exits; tasks in progress are lost.

    Parameters
    ----------
    work : callable
        Module-level function, because processes are spawned.
    tasks : sequence of A
        Arguments of ``work``.
    workers : int
        Number of processes.
    start : callable, optional
        Function called once in each process before its first task.
    arguments : tuple of object, optional
        Arguments of ``start``.
    chunk_size : int, optional
        Tasks handed to a process at a time.

    Raises
    ------
    UserError
        If a process is killed from outside.
    """
    if not tasks:
        return
    # one thread per process, because small matrices gain nothing from more and processes would compete for the cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    older = set(active_children())
    pool = ProcessPoolExecutor(
        min(workers, len(tasks)), get_context("spawn"), _start_process, (start, arguments)
    )
    try:
        yield from pool.map(work, tasks, chunksize=chunk_size)
    except BaseException as error:
        # do not wait for tasks in progress
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(active_children()) - older:
            process.terminate()
        if isinstance(error, BrokenProcessPool):
            raise UserError(
                "a worker process was killed, perhaps for lack of memory; run the command again to resume"
            ) from error
        raise
    pool.shutdown()


def _start_process(start: Callable[..., object] | None, arguments: tuple[object, ...]) -> None:
    """Initialise a worker: ignore Ctrl-C, which the parent handles, exit with the parent, and call ``start``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=leave_with_parent, daemon=True).start()
    if start is not None:
        start(*arguments)
