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

MAX_BYTES = 64_000_000
MAX_S = 2.0
"""Largest amount of frames that a loss of power may cost, in bytes or seconds."""


@dataclass(frozen=True, eq=False)
class FrameFiles:
    """The files of one frame.

    Parameters
    ----------
    parts : all but its record. record : gets its name after all of them. lines : of the manifest.
    """

    parts: Files
    record: tuple[str, bytes]
    lines: bytes

    @property
    def n_bytes(self) -> int:
        """Total size of the files."""
        return sum(len(data) for _, data in (*self.parts, self.record))


class FrameBatches:
    """Writes frames into a store, a batch at a time, while the next is collected. Use as a context manager.

    Leaving it writes what is still held, also after an error elsewhere: a data set is valid as far as it went.

    Raises
    ------
    UserError
        From `add` or at the end, if the store is full or refuses; files that were not stored have no name there.
    """

    def __init__(self, store: Store, *, most_bytes: int = MAX_BYTES, most_s: float = MAX_S) -> None:
        self._store, self._most_bytes, self._most_s = store, most_bytes, most_s
        self._held: list[FrameFiles] = []
        self._since_s = 0.0
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flyaround-write")
        self._under_way: Future[None] | None = None

    def add(self, frame: FrameFiles) -> None:
        """Add one frame; waits if the current batch is full and the previous one is still being written."""
        if not self._held:
            self._since_s = time.monotonic()
        self._held.append(frame)
        if self._under_way is not None and self._under_way.done():
            self._wait()
        if (
            sum(f.n_bytes for f in self._held) >= self._most_bytes
            or time.monotonic() - self._since_s >= self._most_s
        ):
            self._send()

    def flush(self) -> None:
        """Wait until everything added is on the disk."""
        if self._held:
            self._send()
        self._wait()

    def _send(self) -> None:
        self._wait()
        batch, self._held = self._held, []
        self._under_way = self._thread.submit(self._write, batch)

    def _wait(self) -> None:
        under_way, self._under_way = self._under_way, None
        if under_way is not None:
            try:
                under_way.result()
            except BaseException:
                self._held = []  # the disk that took no more takes these no more either
                raise

    def _write(self, batch: list[FrameFiles]) -> None:
        # the lines first: a frame that has its name when the process is killed can be verified for ever
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
