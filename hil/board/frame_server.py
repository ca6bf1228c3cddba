"""Frame server: receives the frames of a session, runs the estimator and answers each frame once."""

from __future__ import annotations

import contextlib
import logging
import math
import queue
import threading
from dataclasses import dataclass
from typing import Optional

from flyaround.hil.board.answering import BoardEstimator, FrameContext, estimated_pose
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.errors import LinkClosed, PacketError, ProtocolMistake
from flyaround.hil.link.packets.images import FrameAssembler
from flyaround.hil.link.packets.messages import (
    NO_FRAME,
    Bye,
    Credit,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    FrameHeader,
    HelloAck,
    Message,
    PoseMessage,
    TimeSyncReply,
    TimeSyncRequest,
)
from flyaround.hil.link.packets.pixels import Image
from flyaround.hil.link.session import Link

logger = logging.getLogger(__name__)

# Largest number of logged line errors in a session, so that a noisy line does not fill the disk.
MAX_LOGGED = 100
# Time for the worker thread to finish when the session ends [s].
JOIN_TIMEOUT_S = 1.0
# Interval of the clock requests that show the host that the board is alive while its estimator works [s].
CLOCK_REQUEST_S = 0.4
# Factor on the silence time-out before the host's first reply, because a serial line may need seconds.
FIRST_REPLY_FACTOR = 5.0
# Longest interval between two checks of the stop flag and of the watchdog [s].
CHECK_INTERVAL_S = 0.5


@dataclass(frozen=True)
class BoardSummary:
    """Summary of a session of the board.

    Parameters
    ----------
    frames : int
        Number of frames answered.
    accepted : int
        Number of answers with an accepted pose.
    goodbye : bool
        True if the host ended the session with a goodbye.
    ended : str
        One sentence on why it ended.
    hung : bool, optional
        True if the watchdog ended the session because the estimator did not return.
    busy : bool, optional
        True if the estimator was still processing a frame of this session, whose answer is discarded.
    """

    frames: int
    accepted: int
    goodbye: bool
    ended: str
    hung: bool = False
    busy: bool = False


@dataclass(frozen=True)
class _Arrival:
    header: FrameHeader
    image: Image
    receive_ns: int


class FrameServer:
    """Server of one session's frames, in three threads.

    One thread receives packets and answers clock requests, one runs the estimator, and the caller's supervises both.

    Parameters
    ----------
    link : Link
        Link after the handshake that settled ``terms``.
    terms : HelloAck
        Terms of the session.
    estimator : BoardEstimator
        Estimator that answers the frames.
    window : int
        Number of complete frames that the board announced it can hold.
    watchdog_s : float, optional
        Longest processing time of a frame; the session ends if it is exceeded.
    silence_s : float, optional
        Time without any message, replies to clock requests included, after which the host is considered lost.
    """

    def __init__(
        self,
        link: Link,
        terms: HelloAck,
        estimator: BoardEstimator,
        window: int,
        *,
        watchdog_s: float = math.inf,
        silence_s: float = math.inf,
    ) -> None:
        self._link, self._terms, self._estimator = link, terms, estimator
        self._watchdog_s, self._silence_s = watchdog_s, silence_s
        # queue length: no more than this board announced, whatever the host sends
        self._room = max(1, min(window, terms.window))
        self._arrivals: queue.Queue[Optional[_Arrival]] = queue.Queue()
        self._assembler = FrameAssembler(terms)
        self._logged = 0
        self._newest = NO_FRAME
        self._patience = FIRST_REPLY_FACTOR
        self._frames = self._accepted = 0
        self._goodbye = self._hung = False
        self._end_reason = "the host went away"
        self._watchdog_message = (
            f"the watchdog stopped the estimator, which took longer than {watchdog_s:g} s"
        )
        self._stop, self._over = threading.Event(), threading.Event()
        # the frame being processed and its start; whichever thread clears it under the lock sends the answer
        self._answering = threading.Lock()
        self._in_work: Optional[_Arrival] = None
        self._start_ns = 0
        self._receiver = threading.Thread(target=self._receive, name="link receiver", daemon=True)
        # daemon: a frame being processed must not delay the exit of the program
        self._worker = threading.Thread(target=self._estimate, name="estimator", daemon=True)

    def run(self) -> BoardSummary:
        """Serve frames until the session ends."""
        self._link.transport.set_silence_limit(self._silence_s)
        self._receiver.start()
        self._worker.start()
        try:
            while not self._over.wait(min(CHECK_INTERVAL_S, self._watchdog_s / 4)):
                self._watch()
        finally:
            self._stop.set()
            self._arrivals.put(None)
            self._receiver.join(2.0)
            if not self._hung:
                self._worker.join(JOIN_TIMEOUT_S)
        return BoardSummary(
            self._frames,
            self._accepted,
            self._goodbye and not self._hung,
            f"{self._watchdog_message if self._hung else self._end_reason} after {self._frames} frames",
            self._hung,
            self._worker.is_alive(),
        )

    @property
    def overdue_s(self) -> float:
        """Time by which the current frame exceeds the watchdog limit; negative if it does not."""
        with self._answering:
            if self._in_work is None:
                return -math.inf
            return (now_ns() - self._start_ns) * 1e-9 - self._watchdog_s

    def _watch(self) -> None:
        """Decline the frame on which the estimator hangs, and end the session."""
        if self.overdue_s < 0:
            return
        with self._answering:
            arrival, self._in_work = self._in_work, None
        if arrival is None:
            return  # the estimator returned in the meantime
        frame_id = arrival.header.frame_id
        sentence = self._watchdog_message
        logger.warning("frame %d: %s", frame_id, sentence)
        self._hung = True
        declined = PoseMessage(
            frame_id,
            accepted=False,
            reason=sentence,
            receive_ns=arrival.receive_ns,
            start_ns=self._start_ns,
            end_ns=now_ns(),
        )
        try:
            self._send(declined)
        except LinkClosed as error:
            logger.warning("frame %d: the host cannot be informed (%s)", frame_id, error)
        self._over.set()

    # --- estimating -------------------------------------------------------------------------

    def _estimate(self) -> None:
        try:
            while True:
                arrival = self._arrivals.get()
                if arrival is None or self._stop.is_set():
                    return
                with self._answering:
                    self._in_work, self._start_ns = arrival, now_ns()
                pose = self._answer(arrival, self._start_ns)
                with self._answering:
                    if self._in_work is not arrival or self._stop.is_set():
                        return  # the watchdog answered already, or the session is over
                    self._in_work = None
                self._send(pose)
        except LinkClosed:
            self._receiver.join(JOIN_TIMEOUT_S)  # it reports the reason
        finally:
            self._over.set()

    def _send(self, pose: PoseMessage) -> None:
        self._frames += 1
        self._accepted += pose.accepted
        self._link.send(pose)
        self._link.send(Credit(pose.frame_id, self._terms.window))

    def _answer(self, arrival: _Arrival, start_ns: int) -> PoseMessage:
        header = arrival.header
        context = FrameContext(
            header.frame_id,
            header.t_s,
            arrival.receive_ns,
            start_ns,
            header.sun_camera,
            self._terms.takes_fields,
        )
        return estimated_pose(self._estimator, arrival.image, context, header.transfer.name.lower())

    # --- receiving --------------------------------------------------------------------------

    def _receive(self) -> None:
        last_received, last_received_ns, beat_ns = -1, now_ns(), 0
        try:
            while not self._stop.is_set():
                if now_ns() >= beat_ns:
                    beat_ns = now_ns() + round(CLOCK_REQUEST_S * 1e9)
                    # the next recv reports the closure, after any unread messages
                    with contextlib.suppress(LinkClosed):
                        self._link.send(TimeSyncRequest(now_ns()))
                try:
                    message = self._link.recv(CLOCK_REQUEST_S)
                    if message is not None and not self._handle(message):
                        return
                except ProtocolMistake as mistake:
                    self._report_violation(mistake)
                except PacketError as error:
                    self._report_damage(error)
                self._report_lost_frames()
                stats = self._link.stats
                if stats.received - stats.stale != last_received:
                    last_received, last_received_ns = stats.received - stats.stale, now_ns()
                elif now_ns() - last_received_ns > (patience_s := self._silence_s * self._patience) * 1e9:
                    self._end_reason = (
                        f"the host said nothing for {patience_s:g} s: it hangs, or the line is cut"
                    )
                    return
        except LinkClosed as error:
            self._end_reason = f"the host went away without a goodbye ({error})"
        finally:
            self._over.set()

    def _say(self, message: Message) -> None:
        """Send a message unless the link is closed; unread packets may still hold the host's goodbye."""
        with contextlib.suppress(LinkClosed):
            self._link.send(message)

    def _handle(self, message: Message) -> bool:
        """Handle one message. Return False at the end of the session."""
        at_ns = now_ns()
        if isinstance(message, FrameHeader):
            self._assembler.header(message)
        elif isinstance(message, FrameChunk):
            complete = self._assembler.chunk(message)
            if complete is not None:
                self._newest = complete[0].frame_id
                self._enqueue(_Arrival(complete[0], complete[1], at_ns))
        elif isinstance(message, TimeSyncRequest):
            self._say(answer_time_sync(message, at_ns, self._newest))
        elif isinstance(message, TimeSyncReply):
            self._patience = 1.0
        elif isinstance(message, Bye):
            self._goodbye, self._end_reason = True, f"the host ended the session ({message.reason})"
            return False
        elif isinstance(message, ErrorMessage) and message.code != ErrorCode.CORRUPT:
            self._end_reason = f"the host ended the session: {message.text}"
            return False
        return True

    def _enqueue(self, arrival: _Arrival) -> None:
        if self._arrivals.qsize() < self._room:  # no race: only this thread enqueues frames
            self._arrivals.put(arrival)
            return
        frame_id = arrival.header.frame_id
        text = f"frame {frame_id} came while {self._room} others waited: the window is {self._room}"
        self._warn(text)
        self._say(ErrorMessage(ErrorCode.BUSY, text, frame_id))

    def _report_damage(self, error: PacketError) -> None:
        """Report a corrupt packet and abandon the frame in progress, which cannot be completed."""
        self._warn(str(error))
        self._assembler.abandon()
        if not self._assembler.has_lost:
            self._say(ErrorMessage(ErrorCode.CORRUPT, str(error), NO_FRAME))

    def _report_violation(self, mistake: ProtocolMistake) -> None:
        """Report a protocol violation to the host, which alone can correct it."""
        self._warn(str(mistake))
        frame_id = mistake.frame_id
        if frame_id is None:
            self._say(ErrorMessage(ErrorCode.OTHER, str(mistake), NO_FRAME))
            return
        if frame_id == self._assembler.frame_id:
            self._assembler.abandon()
        self._say(ErrorMessage(ErrorCode.FORMAT, str(mistake), frame_id))

    def _warn(self, sentence: str) -> None:
        self._logged += 1
        if self._logged <= MAX_LOGGED:
            logger.warning(
                "%s%s", sentence, " (further ones are not logged)" if self._logged == MAX_LOGGED else ""
            )

    def _report_lost_frames(self) -> None:
        for frame_id in self._assembler.lost():
            text = f"frame {frame_id} lost a packet on the line"
            self._say(ErrorMessage(ErrorCode.INCOMPLETE, text, frame_id))
