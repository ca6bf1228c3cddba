"""The link's process: owns the sockets, takes the timestamps, decides what became of each frame."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
from collections import deque
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from hil.host.faults.line_faults import FaultJournal, with_line_faults
from hil.host.link_process.in_flight import FramesInFlight
from hil.host.link_process.ipc import (
    BoardDown,
    BoardGreeted,
    BoardUp,
    Close,
    Closed,
    Failed,
    FrameJob,
    FrameResult,
    FrameSlots,
    LinkConfig,
    LinkCounts,
    Listening,
    SlotFree,
    Terms,
)
from hil.host.link_process.pending import PendingLinks
from hil.host.truth.endpoint import TruthEndpoint
from hil.link.clock import ClockFilter, answer_time_sync, now_ns
from hil.link.errors import LinkClosed, LinkError, PacketError, ProtocolMistake, VersionMismatch
from hil.link.packets.images import chunk_count, chunks, encode_image
from hil.link.packets.messages import (
    NO_FRAME,
    Bye,
    Credit,
    ErrorCode,
    ErrorMessage,
    FrameHeader,
    Hello,
    HelloAck,
    Message,
    PoseMessage,
    TimeSyncReply,
    TimeSyncRequest,
    TruthMessage,
)
from hil.link.session import HOST_IN_SESSION, Link, answer_hello, refuse
from hil.link.transports.url import listen

if TYPE_CHECKING:
    from collections.abc import Collection

    from hil.link.transports.base import Listener

logger = logging.getLogger(__name__)

SYNC_BURST = 8
SYNC_EVERY_NS = 1_000_000_000
# a board answers clock requests once its estimator is ready; no frame is sent before
SYNC_PATIENCE_NS = 60_000_000_000
# waits are cut to whole milliseconds by the kernel's poll: spin through the last stretch
SPIN_NS = 1_500_000
# a board that sends without end is listened to this long at a time: frames, loggers and the run get their turn
DRAIN_NS = 20_000_000
# mistakes of a run that are logged one by one; the summary counts them all
MAX_LOGGED = 20
BUSY = "another board is connected to this host: stop it first"

RUN_DIED = "the host's run was killed or died, without a goodbye"


class LinkServer:
    """One thread, one loop: commands from the run, packets from the board, loggers, deadlines."""

    def __init__(self, pipe: Connection, slots_fd: int, config: LinkConfig) -> None:
        self._pipe, self._slots_fd, self._config = pipe, slots_fd, config
        self._listener: Listener = listen(config.url)
        self._truth: TruthEndpoint | None = None
        try:
            self._truth = (
                TruthEndpoint(config.truth_url, self._listener.url) if config.truth_url is not None else None
            )
        except LinkError:
            self._listener.close()
            raise
        self._serial = config.url.startswith("serial")
        self._terms: Terms | None = None
        self._slots: FrameSlots | None = None
        self._link: Link | None = None
        self._ack: HelloAck | None = None
        self._pending = PendingLinks(lambda reason: self._pipe.send(BoardDown(reason)))
        self._unread = False  # the board has said more than was listened to
        self._mistakes = 0
        self._board_up: BoardUp | None = None  # greeted, not yet announced
        self._clock = ClockFilter()
        self._next_sync_ns = 0
        self._waiting: deque[FrameJob] = deque()
        self._journal = FaultJournal()
        self._in_flight = FramesInFlight(self._report, config.timeout_s)
        self._counts = LinkCounts()
        self._blocked_until_ns = 0  # lockstep, out of credit: when to give up
        self._timeout_ns = int(config.timeout_s * 1e9)
        self._closing = False
        self._reason = RUN_DIED

    def run(self) -> None:
        """Serve until the run says Close or goes away."""
        # a run that was killed may be missed first by what is said to it
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
            self._sync_clock()
            ready: list[Any] = wait(self._sources(), self._sleep_s())
            if self._link is not None and (self._unread or self._link.transport in ready):
                self._drain_link()
            if self._pipe in ready:
                self._take_commands()
            self._hear_pending(ready)
            if self._listener in ready:
                self._accept()
            if self._truth is not None:
                if self._truth in ready:
                    self._truth.accept()
                self._truth.flush()

    # --- what to wait for -------------------------------------------------------------------

    def _sources(self) -> list[Any]:
        sources: list[Any] = [self._pipe]
        if self._link is not None:
            sources.append(self._link.transport)
        sources += self._pending.transports
        # a serial port is listener and line in one; a TCP listener stays open to turn others away
        taken = self._link is not None or len(self._pending) > 0
        if self._terms is not None and not (self._serial and taken):
            sources.append(self._listener)
        if self._truth is not None:
            sources.append(self._truth)
        return sources

    def _sleep_s(self) -> float:
        if self._unread:
            return 0.0
        firsts = (self._in_flight.first_deadline_ns, self._pending.first_deadline_ns)
        times = [first for first in firsts if first is not None]
        if self._waiting and self._waiting[0].due_ns is not None:
            times.append(self._waiting[0].due_ns - SPIN_NS)
        if self._blocked_until_ns:
            times.append(self._blocked_until_ns)
        if self._link is not None:
            times.append(self._next_sync_ns)
        if self._truth is not None and self._truth.lagging:
            times.append(now_ns() + 20_000_000)
        left = (min(times) - now_ns()) * 1e-9 if times else 1.0
        return min(1.0, max(0.0, left))

    # --- the run's side ---------------------------------------------------------------------

    def _take_commands(self) -> None:
        try:
            while self._pipe.poll():
                command = self._pipe.recv()
                if isinstance(command, FrameJob):
                    self._waiting.append(command)
                elif isinstance(command, Terms):
                    self._terms = command
                    self._slots = FrameSlots(self._slots_fd, command.n_slots, command.slot_bytes)
                elif isinstance(command, Close):
                    self._closing, self._reason = True, command.reason
                    return
        except (EOFError, ConnectionError):  # the run died
            self._closing = True

    def _drop(self, job: FrameJob, cause: str, reason: str) -> None:
        """A frame that was never sent."""
        self._pipe.send(SlotFree(job.slot))
        self._publish_truth(job)
        self._report(FrameResult(job.frame_id, f"dropped:{cause}", reason, job.due_ns))

    def _report(self, result: FrameResult) -> None:
        """A frame's outcome to the run, with what struck it on purpose."""
        self._pipe.send(replace(result, faults=self._journal.take(result.frame_id)))

    # --- frames out -------------------------------------------------------------------------

    def _send_due(self) -> None:
        while self._waiting:
            job = self._waiting[0]
            if job.due_ns is not None:
                if job.due_ns - now_ns() > SPIN_NS:
                    return
                while now_ns() < job.due_ns:
                    pass
            if self._link is None or self._ack is None:
                self._waiting.popleft()
                self._drop(job, "disconnected", "no board was connected")
            elif self._in_flight.held >= self._ack.window:
                if self._config.mode == "lockstep":
                    # nothing is lost by waiting for the board to finish what the host gave up on
                    self._blocked_until_ns = self._blocked_until_ns or now_ns() + self._timeout_ns
                    if now_ns() < self._blocked_until_ns:
                        return
                self._blocked_until_ns = 0
                self._waiting.popleft()
                self._in_flight.misses += self._in_flight.none_in_flight
                self._drop(job, "no_credit", f"the board still held {self._in_flight.held} frames")
            else:
                self._blocked_until_ns = 0
                self._waiting.popleft()
                self._send_frame(job, self._link, self._ack)

    def _send_frame(self, job: FrameJob, link: Link, ack: HelloAck) -> None:
        assert self._slots is not None  # noqa: S101 - frames come after the terms
        start = now_ns()
        flight = self._in_flight.start(job, start)
        try:
            if job.truth is not None and self._config.truth == "inline":
                link.send(TruthMessage(job.frame_id, job.truth))
            data = encode_image(self._slots.view(job.slot, job.shape, job.dtype), ack.encoding)
            link.send(
                FrameHeader(
                    job.frame_id,
                    job.shape[1],
                    job.shape[0],
                    job.bits,
                    ack.encoding,
                    len(data),
                    chunk_count(len(data), ack.chunk_bytes),
                    job.exposure_s,
                    job.t_s,
                    start,
                    job.epoch_utc,
                )
            )
            for chunk in chunks(job.frame_id, data, ack.chunk_bytes):
                link.send(chunk)
            flight.send_end_ns = now_ns()
        except LinkClosed as error:
            flight.send_end_ns = now_ns()
            self._board_left(str(error))
        self._pipe.send(SlotFree(job.slot))
        self._publish_truth(job)

    def _publish_truth(self, job: FrameJob) -> None:
        if self._truth is not None and job.truth is not None:
            self._truth.publish(job.frame_id, job.truth)

    def _check_hung(self) -> None:
        """A board that leaves frame after frame without an answer counts as gone: another may take its place."""
        limit = self._config.max_misses
        if self._link is None or not limit:
            return
        blocked = bool(self._blocked_until_ns) and now_ns() >= self._blocked_until_ns
        if self._in_flight.misses + self._in_flight.overdue(now_ns()) + blocked >= limit:
            self._blocked_until_ns = 0
            self._board_left(f"it answered none of {limit} frames in a row: it hangs or is too slow")

    # --- the board's side -------------------------------------------------------------------

    def _accept(self) -> None:
        transport = self._listener.accept(0.0)
        if transport is None:
            return
        if self._config.faults.line:
            transport = with_line_faults(transport, self._config.faults, self._journal)
        if self._link is not None:
            refuse(Link(transport), ErrorCode.BUSY, BUSY)
            return
        self._pending.add(transport)
        self._hear_pending([transport])

    def _hear_pending(self, ready: Collection[Any]) -> None:
        if self._link is not None:
            return
        heard = self._pending.hear(ready)
        if heard is None:
            return
        self._link, hello = heard
        self._link.accepts = HOST_IN_SESSION
        self._greet(hello, self._link)
        if self._link is not None:
            self._pending.turn_away(BUSY)
            self._drain_link()

    def _drain_link(self) -> None:
        until_ns = now_ns() + DRAIN_NS
        self._unread = False
        while self._link is not None:
            if now_ns() >= until_ns:
                self._unread = True
                return
            try:
                message = self._link.recv(0.0)
            except VersionMismatch as error:
                refuse(self._link, ErrorCode.VERSION, str(error))
                self._board_left(str(error))
                return
            except ProtocolMistake as mistake:
                self._mistaken(mistake)
                continue
            except PacketError:
                self._in_flight.note_damage()
                continue
            except LinkClosed as error:
                self._board_left(str(error))
                return
            if message is None:
                if self._link.gave_way:
                    continue
                return
            self._handle(message, now_ns(), self._link)

    def _mistaken(self, mistake: ProtocolMistake) -> None:
        """The board sent what the protocol does not allow: never used, always counted."""
        self._mistakes += 1
        if self._mistakes <= MAX_LOGGED:
            last = " (further mistakes are only counted)" if self._mistakes == MAX_LOGGED else ""
            logger.warning("the board broke the link protocol: %s%s", mistake, last)
        if mistake.frame_id is not None:
            self._in_flight.refuse(mistake.frame_id, str(mistake))

    def _handle(self, message: Message, at_ns: int, link: Link) -> None:
        if isinstance(message, Hello):
            self._greet(message, link)
        elif isinstance(message, PoseMessage):
            self._take_pose(message, at_ns)
        elif isinstance(message, Credit):
            self._in_flight.release(message.frame_id)
        elif isinstance(message, TimeSyncReply):
            self._take_sync(message, at_ns, link)
        elif isinstance(message, TimeSyncRequest):
            with contextlib.suppress(LinkClosed):  # the next recv reports it
                link.send(answer_time_sync(message, at_ns))
        elif isinstance(message, ErrorMessage):
            self._take_error(message)
        elif isinstance(message, Bye):
            self._board_left(f"the board ended the session: {message.reason}")

    def _greet(self, hello: Hello, link: Link) -> None:
        assert self._terms is not None  # noqa: S101 - nobody is let in before the terms
        terms = replace(self._terms.ack, chunk_bytes=link.transport.chunk_bytes)
        wish = self._config.compression
        compress = wish == "zstd" or (wish == "auto" and self._serial)
        repeated = self._ack is not None and link.last_sequence != 0
        try:
            ack = answer_hello(hello, terms, compress=compress)
        except LinkError as error:
            refuse(link, ErrorCode.MODEL, str(error))
            self._board_left(str(error))
            return
        if not repeated:
            self._in_flight.lose("the board started again")
            link.session_id = int.from_bytes(os.urandom(8), "little") or 1
            self._clock = ClockFilter()
            self._next_sync_ns = now_ns() + SYNC_PATIENCE_NS
            self._counts = replace(self._counts, sessions=self._counts.sessions + 1)
        self._ack = ack
        self._pipe.send(BoardGreeted())
        try:
            link.send(ack)
            if not repeated:
                link.send(TimeSyncRequest(now_ns()))
        except LinkClosed as error:
            self._board_left(str(error))
            return
        if not repeated:
            # announced once the clocks are compared: a first frame on the line would spoil the exchange
            self._board_up = BoardUp(
                link.transport.name,
                hello.board,
                hello.model_name,
                hello.method,
                ack.encoding.name.lower(),
                ack.window,
            )

    def _take_sync(self, reply: TimeSyncReply, at_ns: int, link: Link) -> None:
        self._clock.add_reply(reply, at_ns)
        if self._board_up is None:
            return
        if len(self._clock) >= SYNC_BURST:
            self._announce()
            return
        with contextlib.suppress(LinkClosed):  # the next recv reports it
            link.send(TimeSyncRequest(now_ns()))

    def _announce(self) -> None:
        if self._board_up is not None:
            self._pipe.send(self._board_up)
            self._board_up = None

    def _take_pose(self, pose: PoseMessage, at_ns: int) -> None:
        if not self._in_flight.answer(pose, at_ns, self._clock.offset_ns):
            self._counts = replace(self._counts, late_poses=self._counts.late_poses + 1)

    def _take_error(self, error: ErrorMessage) -> None:
        damage = error.code in (ErrorCode.CORRUPT, ErrorCode.INCOMPLETE)
        cause = "corrupt" if damage else "protocol"
        if error.frame_id != NO_FRAME and self._in_flight.damaged(error.frame_id, error.text, cause):
            return
        if error.frame_id == NO_FRAME and error.code == ErrorCode.CORRUPT:
            self._in_flight.note_damage()
        elif error.code in (ErrorCode.MODEL, ErrorCode.VERSION):
            self._board_left(error.text)
        elif error.frame_id == NO_FRAME and error.code == ErrorCode.FORMAT:
            self._board_left(error.text)  # it cannot use the camera

    def _board_left(self, reason: str) -> None:
        link, self._link, self._ack, self._board_up = self._link, None, None, None
        self._unread = False
        if link is not None:
            self._add_counts(link)
            link.close()
        # first of all, so that a run in lockstep does not send the next frame into the void
        self._pipe.send(BoardDown(reason))
        self._in_flight.lose(reason)

    def _add_counts(self, link: Link) -> None:
        c, s = self._counts, link.stats
        self._counts = replace(
            c,
            packets_sent=c.packets_sent + s.sent,
            packets_received=c.packets_received + s.received,
            packets_corrupt=c.packets_corrupt + s.corrupt,
            protocol_mistakes=c.protocol_mistakes + s.mistakes,
            sequence_gaps=c.sequence_gaps + s.sequence_gaps,
            clock_round_trip_ns=self._clock.round_trip_ns,
        )

    def _sync_clock(self) -> None:
        if self._link is not None and self._ack is not None and now_ns() >= self._next_sync_ns:
            self._next_sync_ns = now_ns() + SYNC_EVERY_NS
            self._announce()  # a board that never answers clock requests may still answer frames
            try:
                self._link.send(TimeSyncRequest(now_ns()))
            except LinkClosed as error:
                self._board_left(str(error))

    def _shut(self) -> None:
        died = self._reason is RUN_DIED
        self._pending.turn_away(self._reason)
        if self._link is not None:
            self._add_counts(self._link)
            if died:
                # no goodbye: a board must not take a run that was killed for one that is over
                refuse(self._link, ErrorCode.OTHER, RUN_DIED)
            else:
                self._link.close(self._reason)
        self._listener.close()
        if self._truth is not None:
            self._truth.close(None if died else self._reason)
        with contextlib.suppress(OSError):  # the run may be gone
            self._pipe.send(Closed(self._counts))


def main() -> None:
    """Entry of the process: two inherited descriptors, the pipe's and the pixels'."""
    for ending in (signal.SIGINT, signal.SIGTERM):  # the run decides what they mean, and then closes us
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
            pipe.send(Failed(str(error)))
        return
    server.run()


if __name__ == "__main__":
    main()
