"""Tasks that need no resource kept for them, in several processes: results in the order of the tasks."""

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
    at_once: int = 1,
) -> Generator[B]:
    """Results of ``work(task)``, each task in one of ``workers`` processes.

    A single one is another process, too. Processes end with the generator's closing, at once, and with the process that
    started them, however it ends.

    Parameters
    ----------
    work : a module-level function. start, arguments : called once in each process before its first task.
    at_once : tasks handed to a process at a time.

    Raises
    ------
    UserError
        If a process is ended from outside.
    """
    if not tasks:
        return
    # one thread each: matrices this small gain nothing from more, and processes would fight over the cores
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    others = set(active_children())
    pool = ProcessPoolExecutor(
        min(workers, len(tasks)), get_context("spawn"), _start_process, (start, arguments)
    )
    try:
        yield from pool.map(work, tasks, chunksize=at_once)
    except BaseException as error:
        # whoever stops it waits for no task in work
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(active_children()) - others:
            process.terminate()
        if isinstance(error, BrokenProcessPool):
            raise UserError(
                "a process at work was ended from outside (short of memory?): begin again, it goes on from there"
            ) from error
        raise
    pool.shutdown()


def _start_process(start: Callable[..., object] | None, arguments: tuple[object, ...]) -> None:
    """Ctrl-C is for the process that started this one, which ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=leave_with_parent, daemon=True).start()
    if start is not None:
        start(*arguments)
