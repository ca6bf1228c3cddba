"""Handle of the run on the link process: submits frames and receives outcomes."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import subprocess
import sys
import time
from collections import deque
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Self

import numpy as np

from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.link_process.ipc import (
    AddLineFault,
    BoardDown,
    BoardGreeted,
    BoardUp,
    Close,
    FrameJob,
    FrameSlots,
    LinkConfig,
    LinkTotals,
    Listening,
    PixelFormatName,
    SlotFree,
    Terms,
)
from flyaround.hil.link.packets.images import formats_of
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.carrier import open_anonymous_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.link.packets.messages import HelloAck, PixelFormat
    from flyaround.simulator.scenario.faults import LineFault

logger = logging.getLogger(__name__)

# Time-out for the link process to open its ports [s], and to end after Close [s]: it still
# sends its last messages. A process that takes longer is killed.
START_TIMEOUT_S = 60.0
CLOSE_TIMEOUT_S = 15.0
# Time-out for the last message of a link process after Close, or of an interrupted run [s]
QUICK_TIMEOUT_S = 2.0
# Time for which one call waits for the process's messages [s]; it ends the wait early
POLL_S = 0.2
# Time for a board to prepare its estimator after HELLO [s], slightly more than the link process allows
READY_TIMEOUT_S = 65.0

PROCESS_ENDED = "the link process ended unexpectedly: the log so far is intact; run again with -v"


def choose_pixel_format(bits: int, channels: tuple[int, ...], wish: PixelFormatName) -> PixelFormat:
    """Return the pixel format of the images on the line.

    Parameters
    ----------
    bits : int
        Bits per pixel of the detector.
    channels : tuple of int
        Shape of the images beyond rows and columns: empty, or (3,).
    wish : PixelFormatName
        Requested format, or ``auto``.

    Returns
    -------
    PixelFormat
        Format that holds the images whole.

    Raises
    ------
    UserError
        If no format of the link, or not the requested one, can hold the images without loss.
    """
    holding = formats_of(bits, *(channels or (1,)))
    for candidate in holding:
        if wish in ("auto", candidate.name):
            return candidate
    kind = "colour pictures" if channels else "pictures"
    if not holding:
        raise UserError(f"{kind} of {bits} bits cannot be sent to a board; write bits = 8 under [sensor]")
    raise UserError(
        f"{kind} of {bits} bits do not fit the pixel format {wish}: choose {' or '.join(f.name for f in holding)}"
    )


class HostLink:
    """Handle of the link process, which it starts; a context manager.

    Raises
    ------
    UserError
        If a port is in use or the URL is invalid.
    """

    def __init__(self, config: LinkConfig) -> None:
        parent_socket, child_socket = socket.socketpair()
        self._fd = open_anonymous_file()
        # -P: a folder named hil in the working directory must not shadow the package
        command = [
            sys.executable,
            "-P",
            "-m",
            "flyaround.hil.host.link_process.process",
            str(child_socket.fileno()),
            str(self._fd),
        ]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        self._process = subprocess.Popen(command, pass_fds=(child_socket.fileno(), self._fd), env=environment)
        child_socket.close()
        self._pipe = Connection(parent_socket.detach())
        self._slots: FrameSlots | None = None
        self._free: list[int] = []
        self._results: deque[FrameRecord] = deque()
        self._listening: Listening | None = None
        self.board: BoardUp | None = None
        self.last_board: BoardUp | None = None
        self.down_reason = ""
        self.down_since_s = time.monotonic()
        self._greeted_s: float | None = None
        self.counts = LinkTotals()
        self.closed = False
        try:
            self._send_message(config)
            deadline = time.monotonic() + START_TIMEOUT_S
            while self._listening is None and time.monotonic() < deadline:
                self.pump(POLL_S)
            if self._listening is None:
                raise UserError(f"the link process did not open {config.url}: run again with -v to see why")
        except BaseException:
            self._kill()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """URL for boards, with the actual port."""
        return self._listening.url if self._listening else ""

    @property
    def truth_url(self) -> str | None:
        """URL for truth loggers; None without a truth endpoint."""
        return self._listening.truth_url if self._listening else None

    def open(self, ack: HelloAck, n_slots: int, slot_bytes: int) -> None:
        """Admit boards on these terms."""
        os.ftruncate(self._fd, n_slots * slot_bytes)
        self._slots = FrameSlots(self._fd, n_slots, slot_bytes)
        self._free = list(range(n_slots))
        self._send_message(Terms(ack, n_slots, slot_bytes))

    @property
    def has_room(self) -> bool:
        """True if ``submit`` has a free slot."""
        return bool(self._free)

    def submit(self, image: NDArray[np.generic], job: FrameJob) -> None:
        """Submit a frame, whose pixels are copied; requires ``has_room``.

        Raises
        ------
        RuntimeError
            If there are no terms yet or no slot is free.
        """
        if self._slots is None or not self._free:
            raise RuntimeError("a frame was submitted without terms or a free slot")
        slot = self._free.pop()
        self._slots.view(slot, image.shape, image.dtype.str)[...] = image
        record = job.record.with_times(drawn_ns=time.monotonic_ns())
        self._send_message(replace(job, record=record, slot=slot, shape=image.shape, dtype=image.dtype.str))

    def add_line_fault(self, fault: LineFault) -> None:
        """Add a fault of the line, if the configuration allows it."""
        self._send_message(AddLineFault(fault))

    def pump(self, timeout_s: float) -> None:
        """Process messages of the link process, waiting up to ``timeout_s`` for the first one.

        Raises
        ------
        UserError
            If the link process ended.
        """
        try:
            while self._pipe.poll(timeout_s):
                self._take(self._pipe.recv())
                timeout_s = 0.0
        except (EOFError, OSError) as error:
            self.closed = True
            raise UserError(PROCESS_ENDED) from error

    def results(self) -> list[FrameRecord]:
        """Return the outcomes since the last call."""
        results = list(self._results)
        self._results.clear()
        return results

    def wait_for_board(self, timeout_s: float) -> bool:
        """Return True if a board is ready. It must connect within ``timeout_s``; its estimator may take longer."""
        deadline = time.monotonic() + timeout_s
        while self.board is None:
            until = deadline if self._greeted_s is None else max(deadline, self._greeted_s + READY_TIMEOUT_S)
            left_s = until - time.monotonic()
            if left_s <= 0:
                return False
            self.pump(min(left_s, 0.5))
        return True

    def close(self, reason: str = "the run is over", timeout_s: float = CLOSE_TIMEOUT_S) -> None:
        """Say goodbye to the board with the reason, and stop the process; kill it after ``timeout_s``."""
        try:
            if not self.closed:
                with contextlib.suppress(UserError, OSError):
                    self._send_message(Close(reason))
                    deadline = time.monotonic() + timeout_s
                    while not self.closed and time.monotonic() < deadline:
                        self.pump(POLL_S)
        finally:
            self._kill()

    def _send_message(self, message: object) -> None:
        try:
            self._pipe.send(message)
        except OSError as error:
            self.closed = True
            raise UserError(PROCESS_ENDED) from error

    def _kill(self) -> None:
        ended, self.closed = self.closed, True
        try:
            # after its last message the process exits soon; otherwise it may hang on a line that accepts nothing
            self._process.wait(timeout=QUICK_TIMEOUT_S if ended else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._pipe.close()
        with contextlib.suppress(OSError):
            os.close(self._fd)

    def _take(self, event: object) -> None:
        if isinstance(event, FrameRecord):
            self._results.append(event)
        elif isinstance(event, SlotFree):
            self._free.append(event.slot)
        elif isinstance(event, BoardGreeted):
            self._greeted_s = time.monotonic()
        elif isinstance(event, BoardUp):
            self.board = self.last_board = event
            logger.info(
                "board connected from %s: %s, method %s", event.peer, event.board.name, event.board.method
            )
        elif isinstance(event, BoardDown):
            if self.board is None and self._greeted_s is None and self.last_board is not None:
                # some other connection: the board left earlier, for a reason of its own
                logger.warning("a connection was closed: %s", event.reason)
                return
            self.board = self._greeted_s = None
            self.down_reason = event.reason
            self.down_since_s = time.monotonic()
            logger.warning("board gone: %s", event.reason)
        elif isinstance(event, Listening):
            self._listening = event
        elif isinstance(event, LinkTotals):  # the last message
            self.counts = event
            self.closed = True
        elif isinstance(event, UserError):
            self.closed = True
            raise event
