"""A worker process that holds one resource and runs jobs with it in order; arrays travel in shared memory.

Not a thread: a renderer holds Python's lock while a software driver draws.
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

# On a loaded machine a start may take minutes; a process that uses no processor time for long has failed.
_START_TIMEOUT_S = 60.0

# Interval at which the progress of a starting process is checked [s].
_POLL_INTERVAL_S = 0.5
_END_TIMEOUT_S = 1.0  # grace period before a process is killed


class WorkerResource(Protocol):
    """A resource that a worker holds while it lives, for example a renderer."""

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own, picklable
        """Description of the resource for the caller, once it is open."""


class ProcessDiedError(RuntimeError):
    """A worker process has died, and its jobs are lost.

    Parameters
    ----------
    name : str
        Name of the process in messages.
    exit_code : int or None
        Exit code, or minus the number of the signal; None if unknown.
    """

    def __init__(self, name: str, exit_code: int | None) -> None:
        super().__init__(f"the {name} ended unexpectedly (exit code {exit_code})")
        self.exit_code = exit_code


class WorkerProcess(Generic[T]):
    """Process that runs ``work(resource, *arguments, **options)`` in order, a few jobs ahead of the caller.

    Arrays travel in shared memory and are copied once on each side. Use as a context manager.

    Parameters
    ----------
    work : callable
        Module-level function with a picklable result.
    open_resource : callable
        Picklable function, called once in the process; it returns a context manager, left at the end.
    capacity : int, optional
        Largest number of jobs in flight.
    name : str, optional
        Name of the process in messages.

    Raises
    ------
    UserError
        From ``info``, ``ready``, ``result`` and ``results``, if ``open_resource`` or ``work`` raised one.
    RuntimeError
        For any other failure in the process, with its traceback; `ProcessDiedError` if it died.
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
        self._pipe, child_pipe = context.Pipe()
        self._capacity = capacity
        self._submitted = self._in_flight = 0
        self._info: Any = None
        self._is_open = False  # the first message has been read
        self._name = name
        # one carrier per job, reused for its result, because both ends take before they send; the last one carries the
        # resource's info
        self._carriers = [Carrier() for _ in range(capacity + 1)]
        self._process = context.Process(
            target=_serve,
            args=(child_pipe, self._carriers, work, open_resource),
            daemon=True,
            name=f"flyaround {name}",
        )
        try:
            self._process.start()
        except BaseException:
            self._close_channels()
            raise
        finally:
            child_pipe.close()

    @property
    def info(self) -> Any:  # noqa: ANN401 - the resource's own
        """Description of the resource; waits until it is open."""
        if not self._is_open:
            self._wait_for_start()
            self._receive_info()
        return self._info

    def _wait_for_start(self) -> None:
        """Wait for the first message.

        Raises
        ------
        RuntimeError
            If the process has used no processor time for a minute.
        """
        watch = ProgressWatch()
        while not self._pipe.poll(min(_POLL_INTERVAL_S, _START_TIMEOUT_S)):
            if watch.idle_s(self.processor_time_s()) >= _START_TIMEOUT_S:
                raise RuntimeError(
                    f"the {self._name} did not start: it has done nothing for {_START_TIMEOUT_S:.0f} s"
                )

    def processor_time_s(self) -> float:
        """Return the processor time that the process has used [s]; 0 if the system does not report it."""
        return _processor_time_s(self.pid)

    @property
    def pid(self) -> int | None:
        """Process identifier."""
        return self._process.pid

    @property
    def in_flight(self) -> int:
        """Jobs submitted and not collected yet."""
        return self._in_flight

    @property
    def has_room(self) -> bool:
        """Return True if ``submit`` would accept a job."""
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
        """Return True if ``result`` would return or raise at once; wait up to ``timeout_s``."""
        if not self._is_open:
            if not self._pipe.poll(timeout_s):
                return False
            self._receive_info()
            timeout_s = 0.0
        return self._in_flight > 0 and self._pipe.poll(timeout_s)

    def result(self) -> T:
        """Return the oldest job's result; wait for it.

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
        """Yield the results of all jobs in flight, oldest first."""
        while self._in_flight:
            yield self.result()

    def kill(self) -> None:
        """Kill the process at once; call `close` afterwards."""
        self._process.kill()
        self._process.join()

    def close(self) -> None:
        """End the process; a job in progress is abandoned."""
        if self._process.is_alive():
            # an orderly end would take a renderer a second, and the system frees its resources
            self._process.terminate()
            self._process.join(_END_TIMEOUT_S)
            if self._process.is_alive():
                self._process.kill()
        self._process.join()
        self._close_channels()
        self._in_flight = 0

    def _close_channels(self) -> None:
        self._pipe.close()
        for carrier in self._carriers:
            carrier.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _carrier(self, job: int) -> Carrier:
        """Return the carrier of a job, numbered from 0, and of its result."""
        return self._carriers[job % self._capacity]

    def _receive_info(self) -> None:
        self._info = self._receive(self._carriers[-1])
        self._is_open = True

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

    A process that prepares something for the first time may work for minutes before it answers; one that hangs uses no
    processor time.

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
    """Return the processor time that a process has used [s]; 0 if the system does not report it."""
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
    """Run jobs in the child process until the parent terminates it or exits."""
    # the parent handles Ctrl-C, and then closes this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # end at once on SIGTERM: the system frees all resources
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=leave_with_parent, name="watch parent", daemon=True).start()
    keep_freed_memory()
    *of_jobs, of_info = carriers
    try:
        with open_resource() as resource:
            _send(pipe, _answer(of_info, resource.info))
            for carrier in itertools.cycle(of_jobs):
                message = _next_message(pipe)
                if message is None:
                    return
                try:
                    arguments, options = carrier.take(*message)
                    answer = _answer(carrier, work(resource, *arguments, **options))
                except Exception as error:  # noqa: BLE001 - every failure is reported to the caller
                    answer = _failure(error)
                _send(pipe, answer)
    except Exception as error:  # noqa: BLE001 - the resource could not be opened, described or closed
        _send(pipe, _failure(error))


def leave_with_parent() -> None:
    """End this process when its parent ends, even if the parent was killed."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    os._exit(1)


# Message to the parent: kind, payload, sizes of the arrays [bytes].
_Message = tuple[str, "bytes | str", tuple[int, ...]]


def _answer(carrier: Carrier, value: object) -> _Message:
    return "value", *carrier.put(value)


def _failure(error: Exception) -> _Message:
    if isinstance(error, UserError):
        return "user_error", str(error), ()
    return "error", "".join(traceback.format_exception(error)), ()


def _send(pipe: Connection, message: _Message) -> None:
    """Send a message, unless the parent is gone; then `_next_message` returns None."""
    with contextlib.suppress(ConnectionError):
        pipe.send_bytes(pickle.dumps(message))


def _next_message(pipe: Connection) -> tuple[bytes, tuple[int, ...]] | None:
    """Wait for the next job's message; None means the end, or that the parent is gone."""
    try:
        message = pipe.recv_bytes()
    except (EOFError, ConnectionError):
        return None
    return pickle.loads(message)  # noqa: S301 - our own parent
