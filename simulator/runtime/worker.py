"""A worker process that holds one resource and does jobs with it, in order; arrays come back through shared memory.

Not a thread: a renderer holds Python's lock while a software driver draws, so others could not run.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections import deque
from multiprocessing import connection, shared_memory
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

from simulator.errors import UserError
from simulator.runtime.memory import keep_freed_memory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager
    from multiprocessing.connection import Connection

T = TypeVar("T")

_SHARE_FROM_BYTES = 1 << 16  # smaller results go through the pipe
# Where many share a processor, one that works may take minutes to start; one that does nothing for long never will.
_START_TIMEOUT_S = 60.0
_LOOK_S = 0.5
_END_TIMEOUT_S = 1.0  # for a process that is told to drop its work; then it is killed


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

    Arrays in the results travel through shared memory and are copied once on each side. Use as a context manager.

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
        self._in_flight = 0
        self._info: Any = None
        self._name = name
        self._blocks: dict[str, shared_memory.SharedMemory] = {}
        self._process = context.Process(
            target=_serve,
            args=(theirs, work, open_resource),
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
            self._info = self._receive()
        return self._info

    def _wait_for_start(self) -> None:
        """Wait for the first message.

        Raises
        ------
        RuntimeError
            If the process has done nothing for a minute.
        """
        worked_s, since_s = 0.0, time.monotonic()
        while not self._pipe.poll(min(_LOOK_S, _START_TIMEOUT_S)):
            now_s = _processor_time_s(self.pid)
            if now_s > worked_s:
                worked_s, since_s = now_s, time.monotonic()
            elif time.monotonic() - since_s >= _START_TIMEOUT_S:
                raise RuntimeError(
                    f"the {self._name} did not start: it has done nothing for {_START_TIMEOUT_S:.0f} s"
                )

    @property
    def pid(self) -> int | None:
        """The process's number."""
        return self._process.pid

    @property
    def started(self) -> bool:
        """Whether the resource is there, so that a job is taken up at once; does not wait for it."""
        if self._info is None:
            self.ready()
        return self._info is not None

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
        self._send((arguments, options))
        self._in_flight += 1

    def ready(self, timeout_s: float = 0.0) -> bool:
        """Whether ``result`` would return (or raise) at once; waits up to ``timeout_s``."""
        if self._info is None:
            if not self._pipe.poll(timeout_s):
                return False
            self._info = self._receive()
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
        self._in_flight -= 1
        return self._receive()

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
            with contextlib.suppress(OSError):  # it may have died in the meantime
                self._pipe.send_bytes(pickle.dumps(None))
            if self._in_flight or self._info is None:
                self._process.terminate()
            self._drain(_END_TIMEOUT_S)
            if self._process.is_alive():
                self._process.kill()
        self._process.join()
        self._attach_uncollected()
        self._pipe.close()
        for block in self._blocks.values():
            block.close()
            with contextlib.suppress(FileNotFoundError):  # the process freed it itself
                block.unlink()
        self._blocks.clear()
        self._in_flight = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _drain(self, timeout_s: float) -> None:
        """Wait for the process to end; results that nobody collects must not block its last send."""
        deadline = time.monotonic() + timeout_s
        while self._process.is_alive() and time.monotonic() < deadline:
            try:
                if self._pipe.poll(0.02):
                    self._pipe.recv_bytes()
            except (EOFError, OSError):
                self._process.join(max(0.0, deadline - time.monotonic()))

    def _send(self, message: object) -> None:
        try:
            self._pipe.send_bytes(pickle.dumps(message, protocol=5))
        except (BrokenPipeError, ConnectionError) as error:
            raise self._death() from error

    def _receive(self) -> Any:  # noqa: ANN401 - whatever `work` returns
        try:
            kind, payload, block_name, sizes = pickle.loads(self._pipe.recv_bytes())  # noqa: S301 - our own child
        except (EOFError, OSError) as error:  # OSError: it died in the middle of a message
            self._in_flight = 0
            raise self._death() from error
        if kind == "user_error":
            raise UserError(payload)
        if kind == "error":
            raise RuntimeError(f"the {self._name} failed: {payload}")
        if block_name is None:
            return pickle.loads(payload)  # noqa: S301 - our own child
        if block_name not in self._blocks:
            self._blocks[block_name] = shared_memory.SharedMemory(name=block_name)
        view, buffers, start = _memory(self._blocks[block_name]), [], 0
        for size in sizes:
            buffers.append(bytearray(view[start : start + size]))
            start += size
        self._send(block_name)  # the block may be used again
        return pickle.loads(payload, buffers=buffers)  # noqa: S301 - our own child

    def _death(self) -> ProcessDiedError:
        self._process.join(timeout=5)
        return ProcessDiedError(self._name, self._process.exitcode)

    def _attach_uncollected(self) -> None:
        """Take the blocks of results that a process which died has sent and nobody has read, to free them."""
        with contextlib.suppress(OSError, EOFError):
            while self._pipe.poll():
                name = pickle.loads(self._pipe.recv_bytes())[2]  # noqa: S301 - our own child
                if name is None or name in self._blocks:
                    continue
                with contextlib.suppress(FileNotFoundError):  # the process freed this one itself
                    self._blocks[name] = shared_memory.SharedMemory(name=name)


def _processor_time_s(pid: int | None) -> float:
    """Processor time that a process has used; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:  # noqa: PTH123 - no file of ours
            fields = file.read().rpartition(b")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0


def _memory(block: shared_memory.SharedMemory) -> memoryview:
    """The bytes of a block that has not been closed."""
    if block.buf is None:
        raise RuntimeError("a closed block of shared memory was used")
    return block.buf


class _Results:
    """The child's side of the results: a few blocks of shared memory, used in turn."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._free: deque[shared_memory.SharedMemory] = deque()
        self._busy: dict[str, shared_memory.SharedMemory] = {}

    def release(self, name: str) -> None:
        """Take a block back."""
        block = self._busy.pop(name, None)
        if block is not None:
            self._free.append(block)

    def send(self, value: object) -> None:
        """Pickle a result, large buffers aside."""
        buffers: list[pickle.PickleBuffer] = []
        payload = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
        views = [buffer.raw() for buffer in buffers]
        total = sum(view.nbytes for view in views)
        if total < _SHARE_FROM_BYTES:
            payload = pickle.dumps(value, protocol=5)
            self._pipe.send_bytes(pickle.dumps(("value", payload, None, ())))
            return
        block = self._take(total)
        self._busy[block.name] = block
        start, memory = 0, _memory(block)
        for view in views:
            memory[start : start + view.nbytes] = view
            start += view.nbytes
        sizes = tuple(view.nbytes for view in views)
        self._pipe.send_bytes(pickle.dumps(("value", payload, block.name, sizes)))

    def _take(self, size: int) -> shared_memory.SharedMemory:
        for _ in range(len(self._free)):
            block = self._free.popleft()
            if block.size >= size:
                return block
            block.close()
            block.unlink()
        return shared_memory.SharedMemory(create=True, size=size)

    def close(self) -> None:
        """Free every block."""
        for block in (*self._free, *self._busy.values()):
            with contextlib.suppress(BufferError):  # it is being written to
                block.close()
            with contextlib.suppress(FileNotFoundError):  # the parent was faster
                block.unlink()


def _serve(
    pipe: Connection,
    work: Callable[..., object],
    open_resource: Callable[[], AbstractContextManager[WorkerResource]],
) -> None:
    """Run in the child: do what arrives until told to stop or left alone."""
    # Ctrl-C is the parent's to handle; it then closes us
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    results = _Results(pipe)
    signal.signal(signal.SIGTERM, lambda *_: _leave(results))
    threading.Thread(target=_leave_with_parent, name="watch parent", daemon=True).start()
    keep_freed_memory()
    try:
        with open_resource() as resource:
            results.send(resource.info)
            while True:
                message = pickle.loads(pipe.recv_bytes())  # noqa: S301 - our own parent
                if message is None:
                    return
                if isinstance(message, str):
                    results.release(message)
                    continue
                arguments, options = message
                try:
                    value = work(resource, *arguments, **options)
                except Exception as error:  # noqa: BLE001 - every failure is the caller's to see
                    _report(pipe, error)
                else:
                    results.send(value)
    except (EOFError, ConnectionError):
        return  # the parent is gone
    except Exception as error:  # noqa: BLE001 - the resource could not be had
        _report(pipe, error)
    finally:
        results.close()


def _leave(results: _Results) -> None:
    """Drop the job in work and end at once: shared memory is freed, the rest is the system's to take back."""
    results.close()
    os._exit(1)


def _leave_with_parent() -> None:
    """End once the parent has: one that was killed tells nobody, and a job or a start-up may take long."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_END_TIMEOUT_S)
    os._exit(1)


def _report(pipe: Connection, error: Exception) -> None:
    if isinstance(error, UserError):
        message = ("user_error", str(error), None, ())
    else:
        message = ("error", "".join(traceback.format_exception(error)), None, ())
    pipe.send_bytes(pickle.dumps(message))
