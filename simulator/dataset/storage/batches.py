"""Background writer of frames in batches, so that one disk flush serves many files."""

from __future__ import annotations

import contextlib
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from flyaround.simulator.dataset.storage.manifest import MANIFEST_NAME

if TYPE_CHECKING:
    from flyaround.simulator.dataset.storage.store import Files, Store

# Size of the waiting files above which a batch is written [bytes].
MAX_BYTES = 64_000_000

MAX_S = 2.0
"""Limits of a batch in bytes and seconds, and so of the frames that a loss of power may cost."""


@dataclass(frozen=True, eq=False)
class FrameFiles:
    """The files of one frame.

    Parameters
    ----------
    parts : Files
        All files but the record.
    record : tuple
        File renamed last.
    lines : bytes
        Lines of the manifest.
    """

    parts: Files
    record: tuple[str, bytes]
    lines: bytes

    @property
    def n_bytes(self) -> int:
        """Total size of the files."""
        return sum(len(data) for _, data in (*self.parts, self.record))


class FrameBatches:
    """Background writer of frames into a store, in batches. Use as a context manager.

    On exit the remaining frames are written, also after an exception, so that the data set stays valid.

    Raises
    ------
    UserError
        From `add` or on exit, if the store is full or rejects a file. A file that was not stored has no name there.
    """

    def __init__(self, store: Store, *, max_bytes: int = MAX_BYTES, max_s: float = MAX_S) -> None:
        self._store, self._most_bytes, self._most_s = store, max_bytes, max_s
        self._batch: list[FrameFiles] = []
        self._batch_start_s = 0.0
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flyaround-write")
        self._pending_write: Future[None] | None = None

    def add(self, frame: FrameFiles) -> None:
        """Add one frame; waits if the current batch is full and the previous one is still being written."""
        if not self._batch:
            self._batch_start_s = time.monotonic()
        self._batch.append(frame)
        if self._pending_write is not None and self._pending_write.done():
            self._wait()
        if (
            sum(f.n_bytes for f in self._batch) >= self._most_bytes
            or time.monotonic() - self._batch_start_s >= self._most_s
        ):
            self._send()

    def flush(self) -> None:
        """Wait until everything added is on the disk."""
        if self._batch:
            self._send()
        self._wait()

    def _send(self) -> None:
        self._wait()
        batch, self._batch = self._batch, []
        self._pending_write = self._thread.submit(self._write, batch)

    def _wait(self) -> None:
        pending, self._pending_write = self._pending_write, None
        if pending is not None:
            try:
                pending.result()
            except BaseException:
                self._batch = []  # retrying the same batch on a full disk would fail again
                raise

    def _write(self, batch: list[FrameFiles]) -> None:
        # manifest first: a frame that gets its name before the process is killed can always be verified
        self._store.append(MANIFEST_NAME, b"".join(frame.lines for frame in batch))
        self._store.write(
            [part for frame in batch for part in frame.parts], [frame.record for frame in batch]
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            # report the first error
            with contextlib.suppress(Exception) if kind is not None else contextlib.nullcontext():
                self.flush()
        finally:
            self._thread.shutdown()
