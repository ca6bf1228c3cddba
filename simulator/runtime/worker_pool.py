"""Several worker processes that take jobs in turn, for more jobs per second."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, NoReturn, Self, TypeVar

from flyaround.simulator.runtime.worker import ProcessDiedError, ProgressWatch, WorkerProcess, WorkerResource

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

MAX_CONSECUTIVE_DEATHS = 3
"""Consecutive deaths without a result after which processes are not restarted."""

UNMEASURED_FACTOR = 15.0
"""Factor on the time-out if the system does not report the processor time of another process."""

T = TypeVar("T")


class JobsLostError(Exception):
    """All jobs in flight are lost and can be submitted again."""


class WorkerPool(Generic[T]):
    """Pool of ``count`` processes that run ``work(resource, *arguments, **options)``. Use as a context manager.

    A result depends on its job alone, not on the process. Errors are those of `WorkerProcess`.

    Parameters
    ----------
    work : callable
        Function that processes a job; see `WorkerProcess`.
    count : int
        Number of processes.
    open_resource : callable
        Function that opens the resource of a process; see `WorkerProcess`.
    capacity : int, optional
        Largest number of jobs in flight in each process.
    name : str, optional
        Name of the processes in messages.
    restarts : bool, optional
        True to restart all processes if one dies.
    answer_within_s : float, optional
        Restart processes that use no processor time for this long while a result is due; None waits for ever.
    clock : callable, optional
        Monotonic time [s].

    Raises
    ------
    ValueError
        If there is no process.
    """

    def __init__(
        self,
        work: Callable[..., T],
        count: int,
        *,
        open_resource: Callable[[], AbstractContextManager[WorkerResource]],
        capacity: int = 2,
        name: str = "worker process",
        restarts: bool = False,
        answer_within_s: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if count < 1:
            raise ValueError(f"the number of processes must be at least 1, got {count}")
        self._make = partial(WorkerProcess, work, open_resource=open_resource, capacity=capacity, name=name)
        self._count, self._name = count, name
        self._restarts, self._answer_within_s = restarts, answer_within_s
        self._deaths, self._clock = 0, clock
        self._start()

    def _start(self) -> None:
        self._asked = self._given = 0
        self._progress = ProgressWatch(self._clock)
        with ExitStack() as stack:
            self._processes = [stack.enter_context(self._make()) for _ in range(self._count)]
            self._open = stack.pop_all()

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own
        """Description of the first process's resource; waits until it is open."""
        return self._processes[0].info

    @property
    def pids(self) -> tuple[int | None, ...]:
        """Identifiers of the processes."""
        return tuple(process.pid for process in self._processes)

    @property
    def in_flight(self) -> int:
        """Number of jobs submitted and not yet collected."""
        return self._asked - self._given

    @property
    def has_room(self) -> bool:
        """Return True if ``submit`` would accept a job."""
        return self._next_to(self._asked).has_room

    def _next_to(self, job: int) -> WorkerProcess[T]:
        """Return the process that does a job, numbered from 0: each in turn."""
        return self._processes[job % self._count]

    def submit(self, *arguments: object, **options: object) -> bool:
        """Queue one job for the process whose turn it is.

        Returns
        -------
        bool
            True if the job is queued; False if that process has no room, and the job is not queued.

        Raises
        ------
        JobsLostError
            If a process died and all were restarted.
        """
        if not self.has_room:
            return False
        if not self.in_flight:
            self._progress.restart()
        try:
            self._next_to(self._asked).submit(*arguments, **options)
        except ProcessDiedError as error:
            self._restart(error)
        self._asked += 1
        return True

    def ready(self) -> bool:
        """Return True if the oldest job's result can be collected without waiting.

        Returns
        -------
        bool
            True if the oldest job has ended, in a result or an error; False while it runs, and without a job in flight.

        Raises
        ------
        JobsLostError
            If a process died or hung and all were restarted.
        """
        try:
            if self._next_to(self._given).ready():
                return True
        except ProcessDiedError as error:
            self._restart(error)
        self._end_hanging()
        return False

    def _end_hanging(self) -> None:
        """Kill processes that neither answer nor work, if a time-out is set."""
        if self._answer_within_s is None or not self.in_flight:
            return
        worked_s = sum(process.processor_time_s() for process in self._processes)
        idle_s = self._progress.idle_s(worked_s)
        if idle_s > self._answer_within_s * (1.0 if worked_s else UNMEASURED_FACTOR):
            for process in self._processes:
                process.kill()
            self._restart(None, f"has done nothing for {idle_s:.0f} s")

    def result(self) -> T:
        """Wait for the oldest job, and return its result.

        Returns
        -------
        object
            Value that ``work`` returned. Results come in the order of submission.

        Raises
        ------
        RuntimeError
            If nothing was submitted.
        JobsLostError
            If a process died and all were restarted.
        """
        process = self._next_to(self._given)
        if process.in_flight:
            self._given += 1  # a failed job counts as answered
        try:
            value = process.result()
        except ProcessDiedError as error:
            self._restart(error)
        self._deaths = 0
        self._progress.restart()
        return value

    def _restart(self, error: ProcessDiedError | None, what: str = "") -> NoReturn:
        """Restart all processes after one died; raise if too many died in succession."""
        self._deaths += 1
        what = f"the {self._name} " + (what if error is None else f"died (exit code {error.exit_code})")
        if not self._restarts or self._deaths >= MAX_CONSECUTIVE_DEATHS:
            raise error or RuntimeError(what)
        self.close()
        self._start()
        raise JobsLostError(f"{what} and is restarted; the flight continues") from error

    def close(self) -> None:
        """End the processes; jobs in flight are abandoned."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
