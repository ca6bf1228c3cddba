"""Anonymous memory shared by two processes: the system frees it once both have ended, however they end."""

from __future__ import annotations

import mmap
import os
import pickle
import tempfile
from multiprocessing import reduction
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

_SHARE_FROM_BYTES = 1 << 16  # smaller values travel in the message


def open_anonymous_file() -> int:
    """Open an empty unnamed file, to be passed to another process and then sized.

    Returns
    -------
    int
        File descriptor, which the caller closes.
    """
    if hasattr(os, "memfd_create"):
        return os.memfd_create("flyaround")
    with tempfile.TemporaryFile() as file:  # macOS
        return os.dup(file.fileno())


class Carrier:
    """Channel for one value at a time between two processes: arrays in shared memory, the rest in a message.

    It is passed to a process at its start. A value must be taken before the next one is put.
    """

    def __init__(self, fd: int | None = None) -> None:
        self._fd = open_anonymous_file() if fd is None else fd
        self._map: mmap.mmap | None = None

    def __reduce__(self) -> tuple[Callable[[Any], Carrier], tuple[Any]]:
        """Pickle for a starting process, which gets a duplicate of the descriptor."""
        return _from_descriptor, (reduction.DupFd(self._fd),)

    def put(self, value: object) -> tuple[bytes, tuple[int, ...]]:
        """Return a value's message for `take` at the other end; its arrays are copied into the shared memory.

        Returns
        -------
        tuple
            The pickled value without its arrays, and the size of each array [bytes].
        """
        buffers: list[pickle.PickleBuffer] = []
        payload = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
        views = [buffer.raw() for buffer in buffers]
        total = sum(view.nbytes for view in views)
        if total < _SHARE_FROM_BYTES:
            return pickle.dumps(value, protocol=5), ()
        if os.fstat(self._fd).st_size < total:
            os.ftruncate(self._fd, total)
        memory, start = self._mapped(total), 0
        for view in views:
            memory[start : start + view.nbytes] = view
            start += view.nbytes
        return payload, tuple(view.nbytes for view in views)

    def take(self, payload: bytes, sizes: tuple[int, ...]) -> Any:  # noqa: ANN401 - whatever was put
        """Return the value of a message; its arrays are copied, so that the next may be put."""
        buffers, start = [], 0
        if sizes:
            with memoryview(self._mapped(sum(sizes))) as memory:
                for size in sizes:
                    buffers.append(bytearray(memory[start : start + size]))
                    start += size
        return pickle.loads(payload, buffers=buffers)  # noqa: S301 - our own process

    def close(self) -> None:
        """Close this end."""
        if self._map is not None:
            self._map.close()
            self._map = None
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _mapped(self, size: int) -> mmap.mmap:
        """Map the file, again if it has grown."""
        if self._map is None or len(self._map) < size:
            if self._map is not None:
                self._map.close()
            self._map = mmap.mmap(self._fd, 0)
        return self._map


def _from_descriptor(descriptor: Any) -> Carrier:  # noqa: ANN401 - multiprocessing's own
    return Carrier(descriptor.detach())
