"""Session with a board: handshake, messages, clock synchronisation and packet counts."""

from __future__ import annotations

import contextlib
import logging
import math
import os
from collections import Counter, deque
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.host.link_process.ipc import (
    Board,
    BoardDown,
    BoardGreeted,
    BoardUp,
    LinkConfig,
    LinkTotals,
    Terms,
)
from flyaround.hil.link.clock import ClockFilter, answer_time_sync, now_ns
from flyaround.hil.link.errors import (
    FormatRefused,
    LinkClosed,
    LinkError,
    PacketError,
    ProtocolMistake,
    VersionMismatch,
)
from flyaround.hil.link.packets.images import formats_of
from flyaround.hil.link.packets.messages import (
    NO_FRAME,
    Bye,
    Credit,
    Encoding,
    ErrorCode,
    ErrorMessage,
    Hello,
    HelloAck,
    Message,
    PoseMessage,
    TimeSyncReply,
    TimeSyncRequest,
)
from flyaround.hil.link.session import HOST_IN_SESSION, Link, answer_hello, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from flyaround.hil.host.link_process.in_flight import FramesInFlight

logger = logging.getLogger(__name__)

# Encodings by the host's option, in order of preference; raw if the board supports none
ENCODINGS: dict[str, tuple[Encoding, ...]] = {
    "raw": (),
    "png": (Encoding.PNG,),
    "zstd": (Encoding.ZSTD, Encoding.PNG),
}

# Number of clock requests at the start of a session, before the first frame.
SYNC_BURST = 8

# Interval of clock requests after that [ns].
SYNC_EVERY_NS = 250_000_000
# Advance of a clock request [ns]: before a frame the line is free, and the request waits behind nothing
SYNC_ADVANCE_NS = 200_000_000
# Delay before a silent board is asked for its newest frame, and interval of repetitions [ns]
CLOCK_REQUEST_DELAY_NS, CLOCK_REQUEST_INTERVAL_NS = 20_000_000, 100_000_000
# Number of stored round trips, for more than an hour, and largest plausible one [ns]
MAX_TRIPS, MAX_TRIP_NS = 20_000, 10**12
# A board answers clock requests once its estimator is ready; frames are sent after this time-out at the latest [ns]
SYNC_TIMEOUT_NS = 60_000_000_000
# Longest time of receiving from a busy board before frames, loggers and the run are served [ns]
DRAIN_NS = 20_000_000
# Largest number of logged protocol violations in a run; the summary counts all
MAX_LOGGED = 20


class BoardSession:
    """Session of the host with a board, if there is one; after it ends, another may follow.

    Parameters
    ----------
    config : LinkConfig
        Settings of the link.
    send : callable
        Sends a message to the run.
    in_flight : FramesInFlight
        Frames in flight.
    """

    def __init__(self, config: LinkConfig, send: Callable[[object], None], in_flight: FramesInFlight) -> None:
        self._config, self._send, self._in_flight = config, send, in_flight
        self._serial = config.url.startswith("serial")
        self.terms: Terms | None = None
        self.link: Link | None = None
        self.ack: HelloAck | None = None
        self.unread = False  # the board has sent more than was read
        self.next_sync_ns = 0
        self._clock_request_ns = 0
        self.counts = LinkTotals()
        self._mistakes = 0
        self._up: BoardUp | None = None  # greeted, but not yet announced
        self._clock = ClockFilter()
        self._trips_ns: deque[int] = deque(maxlen=MAX_TRIPS)
        self._last_received_ns = 0
        # True if the board requests the time itself, which shows that it is alive while it works
        self._sends_clock_requests = False

    def begin(self, link: Link, hello: Hello) -> bool:
        """Answer a HELLO; return True if the board is accepted and ``link`` becomes the session's."""
        self.link = link
        link.accepts = HOST_IN_SESSION
        self._greet(hello, link)
        return self.link is not None

    def end(self, reason: str, *, goodbye: bool) -> None:
        """Close the session. A missing goodbye tells the board that the run was killed."""
        if self.link is None:
            return
        self._count_packets(self.link)
        if goodbye:
            self.link.close(reason)
        else:
            refuse(self.link, ErrorCode.OTHER, reason)

    def listen(self) -> None:
        """Receive the board's messages for a bounded time."""
        until_ns = now_ns() + DRAIN_NS
        self.unread = False
        while self.link is not None:
            if now_ns() >= until_ns:
                self.unread = True
                return
            try:
                message = self.link.recv(0.0)
                if message is not None:
                    self._last_received_ns = now_ns()
            except VersionMismatch as error:
                refuse(self.link, ErrorCode.VERSION, str(error))
                self.leave(str(error))
                return
            except ProtocolMistake as mistake:
                self._count_violation(mistake)
                continue
            except PacketError:
                self._in_flight.note_damage()
                continue
            except LinkClosed as error:
                self.leave(str(error))
                return
            if message is None:
                if self.link.yielded:
                    continue
                return
            self._handle(message, now_ns(), self.link)

    def _count_violation(self, mistake: ProtocolMistake) -> None:
        """Handle a protocol violation by the board: its content is ignored, and it is counted."""
        self._mistakes += 1
        if self._mistakes <= MAX_LOGGED:
            last = " (further ones are only counted)" if self._mistakes == MAX_LOGGED else ""
            logger.warning("the board violated the link protocol: %s%s", mistake, last)
        if mistake.frame_id is not None:
            self._in_flight.refuse(mistake.frame_id, str(mistake))

    def _handle(self, message: Message, at_ns: int, link: Link) -> None:
        if isinstance(message, Hello):
            self._greet(message, link)
        elif isinstance(message, PoseMessage):
            self._take_pose(message, at_ns, link)
        elif isinstance(message, Credit):
            self._take_credit(message, link)
        elif isinstance(message, TimeSyncReply):
            self._take_clock_reply(message, at_ns, link)
        elif isinstance(message, TimeSyncRequest):
            self._sends_clock_requests = True
            with contextlib.suppress(LinkClosed):  # the next recv reports it
                link.send(answer_time_sync(message, at_ns))
        elif isinstance(message, ErrorMessage):
            self._take_error(message)
        elif isinstance(message, Bye):
            self.leave(f"the board ended the session: {message.reason}")

    def _greet(self, hello: Hello, link: Link) -> None:
        assert self.terms is not None  # noqa: S101 - no board is admitted before the terms
        terms = replace(self.terms.ack, chunk_bytes=link.transport.chunk_bytes)
        if self._config.mode == "realtime":
            # the newest frame waits at the host, where a newer one can replace it
            terms = replace(terms, window=1)
        wish, format_wish = self._config.compression, self._config.pixel_format
        if wish == "auto":
            wish = "zstd" if self._serial else "raw"
        formats = formats_of(terms.bits, terms.pixel_format.channels)
        repeated = self.ack is not None and link.last_sequence != 0
        encoding = terms.camera.get("encoding", "linear")
        if encoding != "linear" and not hello.takes_fields:
            # without the field it would treat them as linear
            sentence = (
                f'pixels are {encoding}, which this board cannot read: write [output] encoding = "linear"'
            )
            refuse(link, ErrorCode.FORMAT, sentence)
            self.leave(sentence)
            return
        try:
            ack = answer_hello(
                hello,
                terms,
                encodings=ENCODINGS[wish],
                pixel_formats=[f for f in formats if format_wish in ("auto", f.name)],
            )
        except FormatRefused as error:
            refuse(link, ErrorCode.FORMAT, str(error))
            self.leave(str(error))
            return
        except LinkError as error:
            refuse(link, ErrorCode.MODEL, str(error))
            self.leave(str(error))
            return
        if not repeated:
            self._in_flight.lose("the board restarted")
            link.session_id = int.from_bytes(os.urandom(8), "little") or 1
            self._clock, self._sends_clock_requests = ClockFilter(), False
            self.next_sync_ns = now_ns() + SYNC_TIMEOUT_NS
            self.counts = msgspec.structs.replace(self.counts, sessions=self.counts.sessions + 1)
        self.ack = ack
        link.transport.set_silence_limit(self._config.silence_s)
        self._send(BoardGreeted())
        try:
            link.send(ack)
            if not repeated:
                link.send(TimeSyncRequest(now_ns()))
        except LinkClosed as error:
            self.leave(str(error))
            return
        if not repeated:
            # announced after the clock synchronisation, which a first frame on the line would disturb
            board = Board(
                name=hello.board,
                model=hello.model_name,
                model_sha256=hello.model_sha256,
                method=hello.method,
                encoding=ack.encoding.name.lower(),
                window=ack.window,
            )
            self._up = BoardUp(link.transport.name, board, ack.takes_fields)

    def _take_clock_reply(self, reply: TimeSyncReply, at_ns: int, link: Link) -> None:
        trip_ns = self._clock.add_reply(reply, at_ns)
        if 0 <= trip_ns < MAX_TRIP_NS:
            self._trips_ns.append(trip_ns)
        if reply.newest_frame is not None:
            self._in_flight.drop_unreceived(reply.asked_ns, reply.newest_frame)
        if self._up is None:
            return
        if len(self._clock) >= SYNC_BURST:
            self._announce()
            return
        with contextlib.suppress(LinkClosed):  # the next recv reports it
            link.send(TimeSyncRequest(now_ns()))

    def _announce(self) -> None:
        if self._up is not None:
            self._send(self._up)
            self._up = None
            self.next_sync_ns = now_ns() + SYNC_EVERY_NS

    def _take_pose(self, pose: PoseMessage, at_ns: int, link: Link) -> None:
        mistake = self._in_flight.violation_of(pose.frame_id)
        if mistake:
            link.stats.add_mistake(mistake, f"frame {pose.frame_id}")
            return
        offset_ns, bound_ns = self._clock.offset_at(at_ns), self._clock.offset_bound_at(at_ns)
        if not self._in_flight.answer(pose, at_ns, offset_ns, bound_ns):
            self.counts = msgspec.structs.replace(self.counts, late_poses=self.counts.late_poses + 1)

    def _take_credit(self, credit: Credit, link: Link) -> None:
        if not self._in_flight.was_sent(credit.frame_id):
            link.stats.add_mistake("credit for a frame that was never sent", f"frame {credit.frame_id}")
            return
        self._in_flight.release(credit.frame_id)

    def _take_error(self, error: ErrorMessage) -> None:
        damage = error.code in (ErrorCode.CORRUPT, ErrorCode.INCOMPLETE)
        cause = "corrupt" if damage else "protocol"
        if error.frame_id != NO_FRAME and self._in_flight.damaged(error.frame_id, error.text, cause):
            return
        if error.frame_id == NO_FRAME and error.code == ErrorCode.CORRUPT:
            self._in_flight.note_damage()
        elif error.code in (ErrorCode.MODEL, ErrorCode.VERSION):
            self.leave(error.text)
        elif error.frame_id == NO_FRAME and error.code == ErrorCode.FORMAT:
            self.leave(error.text)  # the board cannot use the camera

    def leave(self, reason: str) -> None:
        """Handle the loss of the board: its frames are lost, and another board may connect."""
        link, self.link, self.ack, self._up = self.link, None, None, None
        self.unread = False
        if link is not None:
            self._count_packets(link)
            link.close()
        # first, so that a run in lockstep does not send its next frame in vain
        self._send(BoardDown(reason))
        self._in_flight.lose(reason)

    def _count_packets(self, link: Link) -> None:
        c, s, line = self.counts, link.stats, self._clock.line
        self.counts = msgspec.structs.replace(
            c,
            packets_sent=c.packets_sent + s.sent,
            packets_received=c.packets_received + s.received,
            packets_corrupt=c.packets_corrupt + s.corrupt,
            protocol_mistakes=c.protocol_mistakes + s.mistakes,
            mistakes=dict(Counter(c.mistakes) + Counter(s.kinds)),
            sequence_gaps=c.sequence_gaps + s.sequence_gaps,
            clock_round_trip_ms=_ms(self._clock.round_trip_ns),
            clock_round_trip_ms_p50=_ms(_quantile(self._trips_ns, 0.5)),
            clock_round_trip_ms_p99=_ms(_quantile(self._trips_ns, 0.99)),
            clock_round_trip_ms_max=_ms(max(self._trips_ns, default=None)),
            clock_offset_bound_ms=_ms(self._clock.offset_bound_at(now_ns())),
            clock_drift_ppm=None if line is None else line.drift_ppm,
            clock_drift_ppm_sigma=None if line is None else line.sigma_ppm,
        )

    def request_newest_frame(self) -> None:
        """Schedule a request for the newest received frame, unless one was sent since the last was due."""
        sent_ns = self._in_flight.last_sent_ns
        if sent_ns is None:
            return
        due_ns = sent_ns + CLOCK_REQUEST_DELAY_NS
        if self._clock_request_ns >= due_ns:
            due_ns = self._clock_request_ns + CLOCK_REQUEST_INTERVAL_NS
        self.next_sync_ns = min(self.next_sync_ns, due_ns)

    def sync_before_frame(self) -> None:
        """Request the board's clock before a frame occupies the line, if a request is due soon.

        Raises
        ------
        LinkClosed
            If the line is closed.
        """
        if self.link is not None and self._up is None and now_ns() >= self.next_sync_ns - SYNC_ADVANCE_NS:
            self._request_clock(self.link)

    def sync_clock(self) -> None:
        """Request the board's clock and newest frame, if due."""
        if self.link is not None and self.ack is not None and now_ns() >= self.next_sync_ns:
            self._announce()  # a board that never answers clock requests may still answer frames
            try:
                self._request_clock(self.link)
            except LinkClosed as error:
                self.leave(str(error))

    def _request_clock(self, link: Link) -> None:
        self._clock_request_ns = now_ns()
        self.next_sync_ns = self._clock_request_ns + SYNC_EVERY_NS
        link.send(TimeSyncRequest(self._clock_request_ns))

    def check_silence(self) -> None:
        """Close the session of a board that used to request the time but is now silent.

        A board that sends such requests does so from a separate thread, however long its estimator takes. A board that
        never sends them may be single-threaded, and only its frame time-outs count.
        """
        if self.link is None or not self._sends_clock_requests or self.unread:
            return
        if now_ns() - self._last_received_ns > self._config.silence_s * 1e9:
            self.leave(f"the board was silent for {self._config.silence_s:g} s: the line is cut, or it hangs")


def _ms(ns: int | None) -> float | None:
    return None if ns is None else ns * 1e-6


def _quantile(values: Collection[int], share: float) -> int | None:
    """Return the smallest value not exceeded by a share of the values; None without values."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)] if values else None
