"""A worker process that holds one resource and does jobs with it, in order; arrays travel in memory that both have.

Not a thread: a renderer holds Python's lock while a software driver draws, so others could not run.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from multiprocessing import connection
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.carrier import Carrier
from flyaround.simulator.runtime.memory import keep_freed_memory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager
    from multiprocessing.connection import Connection

T = TypeVar("T")

# Where many share a processor, one that works may take minutes to start; one that does nothing for long never will.
_START_TIMEOUT_S = 60.0
_LOOK_S = 0.5
_END_TIMEOUT_S = 1.0  # for a process that is told to end; then it is killed


class WorkerResource(Protocol):
    """What a worker holds while it lives: a renderer, for example."""

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own, picklable
        """What the caller is told of it once it is there."""


class ProcessDiedError(RuntimeError):
    """A worker process is gone, and what it had under way with it.

    Parameters
    ----------
    name : the process as messages call it.
    exit_code : its own, or minus the number of the signal that ended it; None if it is not known.
    """

    def __init__(self, name: str, exit_code: int | None) -> None:
        super().__init__(f"the {name} ended unexpectedly (exit code {exit_code})")
        self.exit_code = exit_code


class WorkerProcess(Generic[T]):
    """Runs ``work(resource, *arguments, **options)`` elsewhere, in order, a few jobs ahead of the caller.

    Arrays of jobs and results travel in shared memory and are copied once on each side. Use as a context manager.

    Parameters
    ----------
    work : a module-level function; its result must be picklable.
    open_resource : called in the process, once; picklable. Its result is a context manager, left at the end.
    capacity : jobs that may be under way or waiting to be collected.
    name : of the process in messages.

    Raises
    ------
    UserError
        From ``info``, ``result`` and ``results``: what ``open_resource`` or ``work`` raised as a user's mistake.
    RuntimeError
        Anything else that went wrong there, with its traceback; `ProcessDiedError` if it died.
    """

    def __init__(
        self,
        work: Callable[..., T],
        *,
        open_resource: Callable[[], AbstractContextManager[WorkerResource]],
        capacity: int = 2,
        name: str = "worker process",
    ) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._capacity = capacity
        self._submitted = self._in_flight = 0
        self._info: Any = None
        self._name = name
        # a job and then its result travel in one, for both ends take what they are sent before they send;
        # the last one is that of the resource's info
        self._carriers = [Carrier() for _ in range(capacity + 1)]
        self._process = context.Process(
            target=_serve,
            args=(theirs, self._carriers, work, open_resource),
            daemon=True,
            name=f"flyaround {name}",
        )
        self._process.start()
        theirs.close()

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own
        """What the resource says of itself; waits until it is there."""
        if self._info is None:
            self._wait_for_start()
            self._info = self._receive(self._carriers[-1])
        return self._info

    def _wait_for_start(self) -> None:
        """Wait for the first message.

        Raises
        ------
        RuntimeError
            If the process has done nothing for a minute.
        """
        watch = ProgressWatch()
        while not self._pipe.poll(min(_LOOK_S, _START_TIMEOUT_S)):
            if watch.idle_s(self.processor_time_s()) >= _START_TIMEOUT_S:
                raise RuntimeError(
                    f"the {self._name} did not start: it has done nothing for {_START_TIMEOUT_S:.0f} s"
                )

    def processor_time_s(self) -> float:
        """Return the processor time that the process has used [s]; 0 where the system does not say."""
        return _processor_time_s(self.pid)

    @property
    def pid(self) -> int | None:
        """The process's number."""
        return self._process.pid

    @property
    def in_flight(self) -> int:
        """Jobs submitted and not collected yet."""
        return self._in_flight

    @property
    def has_room(self) -> bool:
        """Whether ``submit`` would be accepted."""
        return self._in_flight < self._capacity

    def submit(self, *arguments: object, **options: object) -> None:
        """Queue one job.

        Raises
        ------
        RuntimeError
            If ``capacity`` jobs are in flight: collect a result first.
        """
        if not self.has_room:
            raise RuntimeError(
                f"{self._capacity} jobs are in flight; collect a result before submitting more"
            )
        message = self._carrier(self._submitted).put((arguments, options))
        try:
            self._pipe.send_bytes(pickle.dumps(message, protocol=5))
        except (BrokenPipeError, ConnectionError) as error:
            raise self._death() from error
        self._submitted += 1
        self._in_flight += 1

    def ready(self, timeout_s: float = 0.0) -> bool:
        """Whether ``result`` would return (or raise) at once; waits up to ``timeout_s``."""
        if self._info is None:
            if not self._pipe.poll(timeout_s):
                return False
            self._info = self._receive(self._carriers[-1])
            timeout_s = 0.0
        return self._in_flight > 0 and self._pipe.poll(timeout_s)

    def result(self) -> T:
        """The oldest job's result; waits for it.

        Raises
        ------
        RuntimeError
            If nothing was submitted.
        """
        if not self._in_flight:
            raise RuntimeError("no job is in flight")
        _ = self.info  # the first message, if it has not been read yet
        carrier = self._carrier(self._submitted - self._in_flight)
        self._in_flight -= 1
        return self._receive(carrier)

    def results(self) -> Iterator[T]:
        """Everything in flight, oldest first."""
        while self._in_flight:
            yield self.result()

    def kill(self) -> None:
        """End the process at once, even one that does not answer; `close` it after that."""
        self._process.kill()
        self._process.join()

    def close(self) -> None:
        """End the process; a job that it is at is given up, for nobody will collect it."""
        if self._process.is_alive():
            if self._in_flight or self._info is None:
                self._process.terminate()
            else:
                with contextlib.suppress(OSError):  # it may have died in the meantime
                    self._pipe.send_bytes(pickle.dumps(None))
            self._process.join(_END_TIMEOUT_S)
            if self._process.is_alive():
                self._process.kill()
        self._process.join()
        self._pipe.close()
        for carrier in self._carriers:
            carrier.close()
        self._in_flight = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _carrier(self, job: int) -> Carrier:
        """What carries a job, counted from the first, and its result."""
        return self._carriers[job % self._capacity]

    def _receive(self, carrier: Carrier) -> Any:  # noqa: ANN401 - whatever `work` returns
        try:
            kind, payload, sizes = pickle.loads(self._pipe.recv_bytes())  # noqa: S301 - our own child
        except (EOFError, OSError) as error:  # OSError: it died in the middle of a message
            self._in_flight = 0
            raise self._death() from error
        if kind == "user_error":
            raise UserError(payload)
        if kind == "error":
            raise RuntimeError(f"the {self._name} failed: {payload}")
        return carrier.take(payload, sizes)

    def _death(self) -> ProcessDiedError:
        self._process.join(timeout=5)
        return ProcessDiedError(self._name, self._process.exitcode)


class ProgressWatch:
    """Idle time of a process, by the processor time that it uses.

    A process that prepares something for the first time may work for minutes before it answers; one that hangs
    uses no processor time.

    Parameters
    ----------
    clock : callable
        Monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._worked_s = 0.0
        self.restart()

    def restart(self) -> None:
        """Count idle time from now on."""
        self._since_s = self._clock()

    def idle_s(self, worked_s: float) -> float:
        """Return the time since the process last made progress [s].

        Parameters
        ----------
        worked_s : float
            Processor time that it has used so far [s].
        """
        now_s = self._clock()
        if worked_s != self._worked_s:
            self._worked_s, self._since_s = worked_s, now_s
        return now_s - self._since_s


def _processor_time_s(pid: int | None) -> float:
    """Processor time that a process has used; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:  # noqa: PTH123 - no file of ours
            fields = file.read().rpartition(b")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0


def _serve(
    pipe: Connection,
    carriers: list[Carrier],
    work: Callable[..., object],
    open_resource: Callable[[], AbstractContextManager[WorkerResource]],
) -> None:
    """Run in the child: do what arrives until told to stop or left alone."""
    # Ctrl-C is the parent's to handle; it then closes us
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # whatever it is at, it ends at once: what it holds is the system's to take back
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=leave_with_parent, name="watch parent", daemon=True).start()
    keep_freed_memory()
    *of_jobs, of_info = carriers
    try:
        with open_resource() as resource:
            _answer(pipe, of_info, resource.info)
            for carrier in itertools.cycle(of_jobs):
                message = pickle.loads(pipe.recv_bytes())  # noqa: S301 - our own parent
                if message is None:
                    return
                arguments, options = carrier.take(*message)
                try:
                    value = work(resource, *arguments, **options)
                except Exception as error:  # noqa: BLE001 - every failure is the caller's to see
                    _report(pipe, error)
                else:
                    _answer(pipe, carrier, value)
    except (EOFError, ConnectionError):
        return  # the parent is gone
    except Exception as error:  # noqa: BLE001 - the resource could not be had
        _report(pipe, error)


def leave_with_parent() -> None:
    """End once the parent has: one that was killed tells nobody, and a job or a start-up may take long."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    os._exit(1)


def _answer(pipe: Connection, carrier: Carrier, value: object) -> None:
    pipe.send_bytes(pickle.dumps(("value", *carrier.put(value))))


def _report(pipe: Connection, error: Exception) -> None:
    if isinstance(error, UserError):
        message = ("user_error", str(error), ())
    else:
        message = ("error", "".join(traceback.format_exception(error)), ())
    pipe.send_bytes(pickle.dumps(message))
