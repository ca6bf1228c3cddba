"""Several worker processes that take jobs in turn: more of them a second than one alone does."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from flyaround.simulator.runtime.worker import WorkerProcess, WorkerResource

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from contextlib import AbstractContextManager

T = TypeVar("T")


class WorkerPool(Generic[T]):
    """Runs ``work(resource, *arguments, **options)`` in ``count`` processes. Use as a context manager.

    A result depends on its job alone, so the results are those of one process. Errors are those of `WorkerProcess`.

    Parameters
    ----------
    work, open_resource, name : as of `WorkerProcess`.
    count : processes.
    capacity : jobs of each process that may be under way or waiting to be collected.
    """

    def __init__(
        self,
        work: Callable[..., T],
        count: int,
        *,
        open_resource: Callable[[], AbstractContextManager[WorkerResource]],
        capacity: int = 2,
        name: str = "worker process",
    ) -> None:
        if count < 1:
            raise ValueError(f"at least one process must work, got {count}")
        self._asked = self._given = 0
        with ExitStack() as stack:
            self._processes = [
                stack.enter_context(
                    WorkerProcess(work, open_resource=open_resource, capacity=capacity, name=name)
                )
                for _ in range(count)
            ]
            self._open = stack.pop_all()

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own
        """What the first process's resource says of itself; waits until it is there."""
        return self._processes[0].info

    @property
    def pids(self) -> tuple[int | None, ...]:
        """The processes' numbers."""
        return tuple(process.pid for process in self._processes)

    def processor_time_s(self) -> float:
        """Return the processor time that all processes have used [s]; 0 where the system does not say."""
        return sum(process.processor_time_s() for process in self._processes)

    @property
    def in_flight(self) -> int:
        """Jobs submitted and not collected yet."""
        return self._asked - self._given

    @property
    def has_room(self) -> bool:
        """Whether ``submit`` would be accepted."""
        return self._next_to(self._asked).has_room

    def _next_to(self, job: int) -> WorkerProcess[T]:
        """The process that does a job, counted from the first: each in turn."""
        return self._processes[job % len(self._processes)]

    def submit(self, *arguments: object, **options: object) -> None:
        """Queue one job for the process whose turn it is.

        Raises
        ------
        RuntimeError
            If that one has no room: collect a result first.
        """
        self._next_to(self._asked).submit(*arguments, **options)
        self._asked += 1

    def ready(self, timeout_s: float = 0.0) -> bool:
        """Whether ``result`` would return (or raise) at once; waits up to ``timeout_s``."""
        return self._next_to(self._given).ready(timeout_s)

    def result(self) -> T:
        """The oldest job's result; waits for it.

        Raises
        ------
        RuntimeError
            If nothing was submitted.
        """
        process = self._next_to(self._given)
        if process.in_flight:
            self._given += 1  # a job that failed is answered too
        return process.result()

    def map(self, jobs: Iterable[tuple[tuple[object, ...], Mapping[str, object]]]) -> Iterator[T]:
        """Results of many jobs (arguments, options) in order; the n-th is done by process n modulo their number.

        Raises
        ------
        RuntimeError
            If results of a map that was broken off are still to come: they would be taken for this one's.
        """
        if self.in_flight > 0:
            raise RuntimeError("jobs of a map that was broken off are under way; open other processes")
        for arguments, options in jobs:
            if not self.has_room:
                yield self.result()
            self.submit(*arguments, **options)
        while self.in_flight > 0:
            yield self.result()

    def kill(self) -> None:
        """End the processes at once, whatever they are at."""
        for process in self._processes:
            process.kill()

    def close(self) -> None:
        """End the processes."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
