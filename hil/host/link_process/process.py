"""Link process: owns the sockets, takes the time stamps and determines the outcome of each frame."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections import deque
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.faults.line_faults import FaultJournal, with_line_faults
from flyaround.hil.host.link_process.board_session import BoardSession
from flyaround.hil.host.link_process.in_flight import FramesInFlight
from flyaround.hil.host.link_process.ipc import (
    AddLineFault,
    BoardDown,
    Close,
    FrameJob,
    FrameSlots,
    LinkConfig,
    Listening,
    SlotFree,
    Terms,
)
from flyaround.hil.host.link_process.pending import PendingLinks
from flyaround.hil.host.truth.endpoint import TruthEndpoint
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkClosed, LinkError
from flyaround.hil.link.packets.images import chunk_count, chunks, encode_image
from flyaround.hil.link.packets.messages import (
    FrameHeader,
    HelloAck,
    Transfer,
    TruthMessage,
)
from flyaround.hil.link.session import Link
from flyaround.hil.link.transports.url import listen
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.link.transports.base import Listener, Transport

# The kernel's poll rounds waits to whole milliseconds, so the last part is a busy wait [ns]
SPIN_NS = 1_500_000
# Pause before more is sent to a logger whose buffer was full [ns], in which a local network carries a record
TRUTH_RETRY_NS = 20_000_000
BUSY = "another board is connected to this host: stop it first"

RUN_DIED = "the host's run was killed or died, without a goodbye"


class LinkServer:
    """Single-threaded loop over commands of the run, packets of the board, loggers and time-outs."""

    def __init__(self, pipe: Connection, slots_fd: int, config: LinkConfig) -> None:
        self._pipe, self._slots_fd, self._config = pipe, slots_fd, config
        self._listener: Listener = listen(config.url)
        self._truth: TruthEndpoint | None = None
        try:
            self._truth = (
                TruthEndpoint(config.truth_url, self._listener.url, config.key)
                if config.truth_url is not None
                else None
            )
        except LinkError:
            self._listener.close()
            raise
        self._serial = config.url.startswith("serial")
        self._slots: FrameSlots | None = None
        self._pending = PendingLinks(lambda reason: self._pipe.send(BoardDown(reason)), BUSY, config.key)
        self._waiting: deque[FrameJob] = deque()
        self._newest: FrameJob | None = None  # real time: handed over, waits for the board
        self._journal = FaultJournal()
        self._in_flight = FramesInFlight(self._report, config.timeout_s)
        self._board = BoardSession(config, self._pipe.send, self._in_flight)
        self._blocked_until_ns = 0  # lockstep without credit: time-out
        self._timeout_ns = int(config.timeout_s * 1e9)
        self._closing = False
        self._reason = RUN_DIED

    def run(self) -> None:
        """Serve until the run sends Close or disappears."""
        # a killed run may first show as a broken pipe
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self._pipe.send(
                Listening(self._listener.url, self._truth.url if self._truth is not None else None)
            )
            self._serve()
        self._shut()

    def _serve(self) -> None:
        while not self._closing:
            self._check_hung()
            self._send_due()
            self._in_flight.expire(now_ns())
            self._pending.expire(now_ns())
            self._board.sync_clock()
            ready: list[Any] = wait(self._sources(), self._sleep_s())
            if self._board.link is not None and (self._board.unread or self._board.link.transport in ready):
                self._board.listen()
            self._board.check_silence()
            if self._pipe in ready:
                self._take_commands()
            self._pending.admit(self._board, ready, self._accept() if self._listener in ready else None)
            if self._truth is not None:
                if self._truth in ready:
                    self._truth.accept()
                self._truth.flush()

    # --- what to wait for -------------------------------------------------------------------

    def _sources(self) -> list[Any]:
        sources: list[Any] = [self._pipe]
        if self._board.link is not None:
            sources.append(self._board.link.transport)
        sources += self._pending.transports
        # a serial port is listener and line in one; a TCP listener stays open to refuse others
        occupied = self._board.link is not None or len(self._pending) > 0
        if self._board.terms is not None and not (self._serial and occupied):
            sources.append(self._listener)
        if self._truth is not None:
            sources.append(self._truth)
        return sources

    def _sleep_s(self) -> float:
        if self._board.unread:
            return 0.0
        firsts = (self._in_flight.first_deadline_ns, self._pending.first_deadline_ns)
        times = [first for first in firsts if first is not None]
        if self._waiting and (due_ns := self._waiting[0].record.times.due_ns) is not None:
            times.append(due_ns - SPIN_NS)
        if self._newest is not None and (over_ns := self._newest.record.times.handed_over_ns) is not None:
            times.append(over_ns + self._timeout_ns)
        if self._blocked_until_ns:
            times.append(self._blocked_until_ns)
        if self._board.link is not None:
            times.append(self._board.next_sync_ns)
        if self._truth is not None and self._truth.lagging:
            times.append(now_ns() + TRUTH_RETRY_NS)
        left_s = (min(times) - now_ns()) * 1e-9 if times else 1.0
        return min(1.0, max(0.0, left_s))

    # --- the run's side ---------------------------------------------------------------------

    def _take_commands(self) -> None:
        try:
            while self._pipe.poll():
                command = self._pipe.recv()
                if isinstance(command, FrameJob):
                    self._waiting.append(command)
                elif isinstance(command, Terms):
                    self._board.terms = command
                    self._slots = FrameSlots(self._slots_fd, command.n_slots, command.slot_bytes)
                elif isinstance(command, AddLineFault):
                    self._journal.added.append(command.fault)
                elif isinstance(command, Close):
                    self._closing, self._reason = True, command.reason
                    return
        except (EOFError, ConnectionError):  # the run died
            self._closing = True

    def _drop(self, job: FrameJob, cause: str, reason: str) -> None:
        """Drop a frame that was never sent."""
        self._pipe.send(SlotFree(job.slot))
        self._publish_truth(job)
        self._report(job.record.with_outcome(f"dropped:{cause}", reason))

    def _report(self, record: FrameRecord) -> None:
        """Send a frame's outcome to the run, with the deliberate faults of the line that affected it."""
        faults = (*record.faults, *self._journal.take(record.frame_id))
        self._pipe.send(replace(record, faults=faults))

    # --- frames out -------------------------------------------------------------------------

    def _send_due(self) -> None:
        if self._config.mode == "realtime":
            self._hand_over_due()
            self._send_newest()
        else:
            self._send_in_step()

    def _hand_over_due(self) -> None:
        """Take the frames that are due; of those that wait for the board, only the newest is kept."""
        while self._waiting:
            due_ns = self._waiting[0].record.times.due_ns or 0
            if due_ns - now_ns() > SPIN_NS:
                return
            while now_ns() < due_ns:
                pass
            job = _with_hand_over(self._waiting.popleft(), now_ns())
            if self._board.link is None or self._board.ack is None:
                self._drop(job, "disconnected", "no board was connected")
                continue
            if self._newest is not None:
                reason = f"frame {job.record.frame_id} replaced it while it waited for the board"
                self._drop(self._newest, "superseded", reason)
            self._newest = job
            self._send_newest()

    def _send_newest(self) -> None:
        """Send the waiting frame if the board has room for it."""
        job = self._newest
        if job is None:
            return
        waits_until_ns = (job.record.times.handed_over_ns or 0) + self._timeout_ns
        if self._board.link is None or self._board.ack is None:
            self._newest = None
            self._drop(job, "disconnected", "no board was connected")
        elif self._in_flight.held < self._board.ack.window:
            self._newest = None
            self._send_frame(job, self._board.link, self._board.ack)
        elif now_ns() >= waits_until_ns:
            self._newest = None
            self._drop(job, "no_credit", f"the board still held {self._in_flight.held} frames")
        else:
            self._board.request_newest_frame()

    def _send_in_step(self) -> None:
        while self._waiting:
            job = self._waiting[0]
            if self._board.link is None or self._board.ack is None:
                self._waiting.popleft()
                self._drop(job, "disconnected", "no board was connected")
            elif self._in_flight.held >= self._board.ack.window:
                # nothing is lost by waiting for the board to finish a frame that timed out
                self._blocked_until_ns = self._blocked_until_ns or now_ns() + self._timeout_ns
                if now_ns() < self._blocked_until_ns:
                    self._board.request_newest_frame()
                    return
                self._blocked_until_ns = 0
                self._waiting.popleft()
                self._drop(job, "no_credit", f"the board still held {self._in_flight.held} frames")
            else:
                self._blocked_until_ns = 0
                self._waiting.popleft()
                self._send_frame(job, self._board.link, self._board.ack)

    def _send_frame(self, job: FrameJob, link: Link, ack: HelloAck) -> None:
        assert self._slots is not None  # noqa: S101 - frames follow the terms
        start = now_ns()
        if job.record.times.handed_over_ns is None:
            job = _with_hand_over(job, start)
        record = job.record
        flight = self._in_flight.start(record, start)
        try:
            self._board.sync_before_frame()
            if job.truth is not None and self._config.truth == "inline":
                link.send(TruthMessage(record.frame_id, job.truth))
            pixels = self._slots.view(job.slot, job.shape, job.dtype)
            data = encode_image(pixels, ack.encoding, ack.pixel_format)
            link.send(
                FrameHeader(
                    record.frame_id,
                    job.shape[1],
                    job.shape[0],
                    job.bits,
                    ack.encoding,
                    len(data),
                    chunk_count(len(data), ack.chunk_bytes),
                    record.exposure_s,
                    record.t_s,
                    start,
                    record.epoch_utc,
                    ack.pixel_format,
                    job.readout.binning,
                    job.readout.binning,
                    job.readout.roi_px,
                    job.camera_frame,
                    *self._in_utc(record.exposure_ns),
                    job.sun_camera if ack.takes_fields else None,
                    Transfer[str(ack.camera.get("encoding", "linear")).upper()],
                )
            )
            for chunk in chunks(record.frame_id, data, ack.chunk_bytes):
                link.send(chunk)
                self._board.listen()
                self._board.check_silence()
                if not self._in_flight.is_flying(record.frame_id):
                    break  # the board left, or cannot use the rest
            self._in_flight.sent(flight, now_ns())
        except LinkClosed as error:
            self._in_flight.sent(flight, now_ns())
            self._board.leave(str(error))
        self._pipe.send(SlotFree(job.slot))
        self._publish_truth(job)

    def _in_utc(self, exposure_ns: tuple[int, int] | None) -> tuple[int, int]:
        """Return start and end of an exposure as UTC nanoseconds since 1970; zeros if unknown."""
        if exposure_ns is None:
            return 0, 0
        start_ns, end_ns = exposure_ns
        return start_ns + self._config.utc_minus_monotonic_ns, end_ns + self._config.utc_minus_monotonic_ns

    def _publish_truth(self, job: FrameJob) -> None:
        if self._truth is not None and job.truth is not None:
            self._truth.publish(job.record.frame_id, job.truth)

    def _check_hung(self) -> None:
        """Close the session of a board that leaves too many frames unanswered, so that another may connect."""
        limit = self._config.max_misses
        if self._board.link is None or not limit:
            return
        if self._in_flight.unanswered(now_ns()) >= limit:
            self._blocked_until_ns = 0
            self._board.leave(f"it answered none of {limit} frames in a row: it hangs or is too slow")

    # --- the board's side -------------------------------------------------------------------

    def _accept(self) -> Transport | None:
        transport = self._listener.accept(0.0)
        if transport is not None and (self._config.faults.line or self._config.adds_faults):
            transport = with_line_faults(transport, self._config.faults, self._journal)
        return transport

    def _shut(self) -> None:
        died = self._reason is RUN_DIED
        self._pending.refuse_all(self._reason)
        self._board.end(self._reason, goodbye=not died)
        self._listener.close()
        if self._truth is not None:
            self._truth.close(None if died else self._reason)
        with contextlib.suppress(OSError):  # the run may be gone
            self._pipe.send(self._board.counts)


def _with_hand_over(job: FrameJob, at_ns: int) -> FrameJob:
    return replace(job, record=job.record.with_times(handed_over_ns=at_ns))


def main() -> None:
    """Run the process with two inherited descriptors: pipe and pixels."""
    for ending in (signal.SIGINT, signal.SIGTERM):  # the run handles them, and then closes this process
        signal.signal(ending, signal.SIG_IGN)
    pipe = Connection(int(sys.argv[1]))
    try:
        config: LinkConfig = pipe.recv()
    except (EOFError, ConnectionError):  # the run died
        return
    try:
        server = LinkServer(pipe, int(sys.argv[2]), config)
    except LinkError as error:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            pipe.send(UserError(str(error)))
        return
    if config.mode == "realtime":
        _raise_priority()
    server.run()


def _raise_priority() -> None:
    """Raise the priority above computing processes, if permitted, because frames must be sent on time."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


if __name__ == "__main__":
    main()
